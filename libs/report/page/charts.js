// Plain SVG charts: bars along time, bars of amounts, lines, signs.

// Hatches distinguish kinds of work without colour.
const works = {
  mapping: { text: 'mapping', fill: '#0072b2', hatch: null }, packing: { text: 'packing, tracking', fill: '#56b4e9', hatch: 'M0 6L6 0' },
  sending: { text: 'sending', fill: '#e69f00', hatch: 'M0 3H6' }, fusing: { text: 'fusing', fill: '#009e73', hatch: 'M0 0L6 6' },
  judging: { text: 'judging', fill: '#cc79a7', hatch: 'M3 0V6' }, waiting: { text: 'waiting', fill: '#fff', hatch: 'M3 3h.5' },
};

function hatches(kinds) {
  return shape('defs', {}, kinds.map((kind) => shape('pattern', { id: `hatch-${kind}`, width: 6, height: 6, patternUnits: 'userSpaceOnUse' },
    shape('rect', { width: 6, height: 6, fill: works[kind].fill }),
    works[kind].hatch ? shape('path', { d: works[kind].hatch, stroke: kind === 'waiting' ? '#888' : '#fff', 'stroke-width': 1.3 }) : null)));
}

function ticks(most, count) {
  const rough = most / count, power = 10 ** Math.floor(Math.log10(rough || 1)), step = [1, 2, 5, 10].find((factor) => factor * power >= rough) * power;
  const values = [];
  for (let value = 0; value <= most * 1.0001; value += step) values.push(value);
  return values;
}

// rows: {name, bars: [{kind, from, to, title}]}, seconds.
function ganttChart(rows, unitText) {
  const width = 900, left = 150, line = 22, top = 8, height = top + rows.length * line + 42;
  const most = Math.max(1e-6, ...rows.flatMap((row) => row.bars.map((bar) => bar.to)));
  const x = (seconds) => left + (width - left - 20) * seconds / most;
  const kinds = [...new Set(rows.flatMap((row) => row.bars.map((bar) => bar.kind)))];
  const chart = shape('svg', { class: 'chart', viewBox: `0 0 ${width} ${height}`, width, height, role: 'img', 'aria-label': 'Who did what when' }, hatches(kinds));
  for (const value of ticks(most, 8)) {
    chart.append(shape('line', { x1: x(value), x2: x(value), y1: top, y2: height - 36, stroke: '#ddd' }),
      shape('text', { x: x(value), y: height - 22, 'text-anchor': 'middle' }, significant(value, 3).replace(/(\.\d*?)0+$/, '$1').replace(/\.$/, '')));
  }
  chart.append(shape('text', { x: left, y: height - 5 }, unitText));
  rows.forEach((row, index) => {
    const y = top + index * line;
    const name = row.name.length > 20 ? row.name.slice(0, 19) + '…' : row.name;
    chart.append(shape('text', { x: left - 8, y: y + 14, 'text-anchor': 'end' }, name));
    for (const bar of row.bars.filter((one) => one.to > one.from)) {
      const box = shape('rect', { x: x(bar.from), y: y + 3, width: Math.max(1.5, x(bar.to) - x(bar.from)), height: line - 7, fill: `url(#hatch-${bar.kind})`, stroke: '#333', 'stroke-width': .7 });
      box.append(shape('title', {}, `${row.name}: ${works[bar.kind].text}, ${duration(bar.from)} to ${duration(bar.to)}`));
      chart.append(box);
    }
  });
  const legend = make('div', { class: 'key' }, kinds.map((kind) => make('span', {}, shape('svg', { width: 28, height: 13, viewBox: '0 0 28 13', 'aria-hidden': 'true' },
    shape('rect', { width: 27, height: 12, x: .5, y: .5, fill: `url(#hatch-${kind})`, stroke: '#333', 'stroke-width': .7 })), ' ', works[kind].text)));
  return make('div', { class: 'scroll', tabindex: 0, role: 'group', 'aria-label': 'Chart' }, chart, legend);
}

function amountBar(value, most) {
  return shape('svg', { width: 160, height: 12, viewBox: '0 0 160 12', 'aria-hidden': 'true' },
    shape('rect', { x: 0, y: 1, width: most > 0 ? Math.max(value > 0 ? 1 : 0, 160 * value / most) : 0, height: 10, fill: '#555' }));
}

// The sign of the index-th edge or series at a place: eight forms, so that black and white is enough.
function sign(index, x, y, size, attributes) {
  const form = (index + Math.floor(index / 8)) % 8, look = { fill: lookOf(index).colour, stroke: '#000', 'stroke-width': size / 6, ...attributes };
  if (form === 0) return shape('circle', { cx: x, cy: y, r: size, ...look });
  const star = Array.from({ length: 10 }, (_, i) => [(i % 2 ? 0.55 : 1.3) * Math.sin(i * Math.PI / 5), -(i % 2 ? 0.55 : 1.3) * Math.cos(i * Math.PI / 5)]);
  const corners = [null, [[-1, -1], [1, -1], [1, 1], [-1, 1]], [[0, -1.2], [1.15, 0.9], [-1.15, 0.9]], [[0, -1.35], [1.35, 0], [0, 1.35], [-1.35, 0]], [[0, 1.2], [1.15, -0.9], [-1.15, -0.9]],
    star, [[-0.4, -1.2], [0.4, -1.2], [0.4, -0.4], [1.2, -0.4], [1.2, 0.4], [0.4, 0.4], [0.4, 1.2], [-0.4, 1.2], [-0.4, 0.4], [-1.2, 0.4], [-1.2, -0.4], [-0.4, -0.4]],
    [[-1.2, -1], [1.2, -1], [0.25, 0], [1.2, 1], [-1.2, 1], [-0.25, 0]]][form];
  return shape('polygon', { points: corners.map(([right, down]) => `${(x + size * right).toFixed(2)},${(y + size * down).toFixed(2)}`).join(' '), ...look });
}
const signSample = (index) => shape('svg', { width: 18, height: 16, viewBox: '0 0 18 16', 'aria-hidden': 'true' }, sign(index, 9, 8, 5.5));

// Where values stand between two places of a chart, and which of them are named.
function axis(values, logarithmic, from, to, count) {
  const high = values.reduce((a, b) => Math.max(a, b), logarithmic ? 0 : 1e-9), low = values.reduce((a, b) => Math.min(a, b), logarithmic ? Infinity : 0);
  const wide = logarithmic ? Math.log(high / low) || 1 : high - low;
  const at = (value) => from + (to - from) * (logarithmic ? Math.log(value / low) : value - low) / wide;
  if (!logarithmic) {
    const above = ticks(Math.max(high, -low), count);
    return { at, named: [...above.slice(1).map((value) => -value).filter((value) => value >= low), ...above.filter((value) => value <= high * 1.0001)] };
  }
  const named = [];
  for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); ++power)
    for (const factor of high < 300 * low ? [1, 2, 5] : [1]) named.push(factor * 10 ** power);
  const within = (some) => some.filter((value) => value >= 0.99 * low && value <= 1.01 * high), even = within(named);
  return { at, named: even.length > 2 ? even : within(ticks(high, 2 * count)) };
}
const tickText = (value) => String(Number(value.toPrecision(3)));

// series: {name, look, x: [...], y: [...], sign}; with a sign (an index) its points are marked. Logarithmic axes leave out what is not above 0.
function lineChart(series, xText, yText, { logX = false, logY = false } = {}) {
  const width = 900, height = 260, left = 60, bottom = 40, isShown = (one) => (x, i) => (!logX || x > 0) && (!logY || one.y[i] > 0);
  const shown = series.map((one) => ({ ...one, x: one.x.filter(isShown(one)), y: one.y.filter((_, i) => isShown(one)(one.x[i], i)) })).filter((one) => one.x.length > 0);
  const x = axis(shown.flatMap((one) => one.x), logX, left, width - 14, 8), y = axis(shown.flatMap((one) => one.y), logY, height - bottom, 10, 5);
  const chart = shape('svg', { class: 'chart', viewBox: `0 0 ${width} ${height}`, width, height, role: 'img', 'aria-label': `${yText} over ${xText}` });
  for (const value of y.named) chart.append(shape('line', { x1: left, x2: width - 14, y1: y.at(value), y2: y.at(value), stroke: '#ddd' }),
    shape('text', { x: left - 6, y: y.at(value) + 4, 'text-anchor': 'end' }, tickText(value)));
  for (const value of x.named) chart.append(shape('text', { x: x.at(value), y: height - 22, 'text-anchor': 'middle' }, tickText(value)));
  chart.append(shape('text', { x: left, y: height - 5 }, `${xText}; upwards: ${yText}`));
  for (const one of shown) {
    const path = one.x.map((value, i) => `${i === 0 ? 'M' : 'L'}${x.at(value).toFixed(1)} ${y.at(one.y[i]).toFixed(1)}`).join('');
    chart.append(shape('path', { d: path, fill: 'none', stroke: one.look.colour, 'stroke-width': 1.6, 'stroke-dasharray': one.look.dash.join(' ') || null }));
    if (isNumber(one.sign)) one.x.forEach((value, i) => {
      const mark = sign(one.sign, x.at(value), y.at(one.y[i]), 3.5);
      mark.append(shape('title', {}, `${one.name}: ${tickText(one.y[i])} at ${tickText(value)}`));
      chart.append(mark);
    });
  }
  return make('div', { class: 'scroll', tabindex: 0, role: 'group', 'aria-label': 'Chart' }, chart);
}
