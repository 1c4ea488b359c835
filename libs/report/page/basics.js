// Elements, numbers and robots' looks. Nothing here or elsewhere makes HTML of text: texts become text nodes.

const run = JSON.parse(document.getElementById('run').textContent);

function filled(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes || {}))
    if (value !== null && value !== undefined && value !== false) element.setAttribute(name, value === true ? '' : value);
  for (const child of children.flat())
    if (child !== null && child !== undefined) element.append(child);
  return element;
}
const make = (tag, attributes, ...children) => filled(document.createElement(tag), attributes, children);
const shape = (tag, attributes, ...children) =>
  filled(document.createElementNS('http://www.w3.org/2000/svg', tag), attributes, children);

function button(text, action, attributes) {
  const made = make('button', { type: 'button', ...attributes }, text);
  made.addEventListener('click', action);
  return made;
}

function checkbox(text, checked, action) {
  const box = make('input', { type: 'checkbox', checked });
  box.addEventListener('change', () => action(box.checked));
  return make('label', {}, box, ' ', text);
}

function select(label, names, action) {
  const list = make('select', {}, names.map((name, index) => make('option', { value: index }, name)));
  list.addEventListener('change', () => action(Number(list.value)));
  return { list, element: make('label', {}, label + ' ', list) };
}

// head: texts; a text that begins with '#' is a column of numbers.
function table(head, rows, attributes) {
  const kinds = head.map((text) => (text.startsWith('#') ? 'number' : null));
  const line = (tag, cells) =>
    make('tr', {}, cells.map((cell, i) => make(tag, { class: kinds[i], scope: tag === 'th' ? 'col' : null }, cell)));
  const body = make('table', attributes, make('thead', {}, line('th', head.map((text) => text.replace(/^#/, '')))),
    make('tbody', {}, rows.map((cells) => line('td', cells))));
  return make('div', { class: 'scroll', tabindex: 0, role: 'group', 'aria-label': 'Table' }, body);
}

// [name, value]; those without a value are left out.
const factList = (facts) => make('dl', { class: 'facts' }, facts.filter(([, value]) => value !== '' && value !== undefined).map(([name, value]) =>
  make('div', {}, make('dt', {}, name), make('dd', {}, value))));

const isNumber = (value) => typeof value === 'number' && Number.isFinite(value);
const fixed = (value, digits) => (isNumber(value) ? value.toFixed(digits) : '');
function significant(value, digits = 3) {
  if (!isNumber(value)) return '';
  if (value === 0) return '0';
  const places = Math.max(0, digits - 1 - Math.floor(Math.log10(Math.abs(value))));
  return value.toFixed(Math.min(places, 9));
}
function duration(seconds) {
  if (!isNumber(seconds)) return '';
  if (Math.abs(seconds) < 1) return `${significant(seconds * 1000)} ms`;
  if (seconds < 120) return `${significant(seconds)} s`;
  const whole = Math.round(seconds), pad = (number) => String(number).padStart(2, '0');
  const minutes = Math.floor(whole / 60);
  return minutes < 60 ? `${minutes}:${pad(whole % 60)} min` : `${Math.floor(minutes / 60)}:${pad(minutes % 60)}:${pad(whole % 60)} h`;
}
function amount(bytes) {
  if (!isNumber(bytes)) return '';
  const units = ['B', 'kB', 'MB', 'GB', 'TB'];
  let unit = 0;
  for (; bytes >= 1000 && unit < units.length - 1; ++unit) bytes /= 1000;
  return `${unit === 0 ? bytes : significant(bytes)} ${units[unit]}`;
}
const counted = (count, one, many) => `${count} ${count === 1 ? one : many || one + 's'}`;

// Eight colours that any colour vision distinguishes (Okabe and Ito; Tol), darker ones after that, as in map.color.png.
// With the dashes 40 robots look different, in black and white as well.
const colours = [[0, 114, 178], [213, 94, 0], [0, 158, 115], [204, 121, 167], [86, 180, 233], [230, 159, 0], [136, 34, 85], [153, 153, 51]];
const dashes = [[], [9, 4], [2, 4], [12, 4, 2, 4], [18, 5]];
function lookOf(robot) {
  const round = Math.floor(robot / colours.length);
  const colour = colours[robot % colours.length].map((channel) => (round % 2 === 1 ? Math.floor(channel * 0.6) : channel));
  return { colour: `rgb(${colour.join(',')})`, dash: dashes[(robot + round) % dashes.length] };
}
const nameOf = (robot) => (run.robots[robot] ? run.robots[robot].name : '');

function sample(look) {
  return shape('svg', { width: 44, height: 14, viewBox: '0 0 44 14', 'aria-hidden': 'true' },
    shape('line', { x1: 0, y1: 7, x2: 44, y2: 7, stroke: look.colour, 'stroke-width': 3, 'stroke-dasharray': look.dash.join(' ') || null }));
}

// Calls `draw` once the element comes near the window, and before printing.
const waiting = new Map();
const watcher = new IntersectionObserver((entries) => {
  for (const entry of entries) if (entry.isIntersecting) drawNow(entry.target);
}, { rootMargin: '300px' });
function drawNow(element) {
  const draw = waiting.get(element);
  waiting.delete(element);
  watcher.unobserve(element);
  if (draw) draw();
}
function whenSeen(element, draw) {
  waiting.set(element, draw);
  watcher.observe(element);
}
window.addEventListener('beforeprint', () => {
  for (const element of [...waiting.keys()]) drawNow(element);
});

function bytesOf(base64) {
  const text = atob(base64), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes;
}
