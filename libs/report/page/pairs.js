// Pairs of maps: what was decided, why, and the two maps on each other as each hypothesis has them.

const decisions = {
  accepted: { sign: '●', text: 'merged' }, refused: { sign: '✕', text: 'kept apart' }, deferred: { sign: '○', text: 'undecided' },
};
const decisionOf = (pair) => decisions[pair.decision] || { sign: '?', text: pair.decision || 'unknown' };
const mapOfRobot = (name) => run.maps.find((map) => map.kind === 'robot' && map.name === name);

// b_from_a of results: planar (x, y, yaw, scale) or in space (t, q, scale). Returns where a point of b lies in a's map.
function aFromB(transform) {
  const scale = transform.scale || 1;
  if (transform.t) {
    const [tx, ty, tz] = transform.t, [qx, qy, qz, qw] = transform.q, inverse = 1 / scale;
    return (x, y, z) => {  // q* (p - t) / scale
      const px = x - tx, py = y - ty, pz = (z || 0) - tz;
      const cx = 2 * (-qy * pz + qz * py), cy = 2 * (-qz * px + qx * pz), cz = 2 * (-qx * py + qy * px);
      return [inverse * (px + qw * cx - qy * cz + qz * cy), inverse * (py + qw * cy - qz * cx + qx * cz)];
    };
  }
  const cosine = Math.cos(transform.yaw), sine = Math.sin(transform.yaw);
  return (x, y) => {
    const px = (x - transform.x) / scale, py = (y - transform.y) / scale;
    return [cosine * px + sine * py, -sine * px + cosine * py];
  };
}

// Walls of a grid in one colour, what is free nearly white, unknown cells clear.
function tinted(level, wall) {
  const canvas = make('canvas', { width: level.columns, height: level.rows }), context = canvas.getContext('2d', { willReadFrequently: true });
  context.drawImage(level.image, 0, 0);
  const pixels = context.getImageData(0, 0, level.columns, level.rows), data = pixels.data;
  for (let i = 0; i < data.length; i += 4) {
    const shade = data[i];
    if (shade < 100) data.set([...wall, 255], i);
    else data.set([wall[0], wall[1], wall[2], shade > 245 ? 22 : 0], i);
  }
  context.putImageData(pixels, 0, 0);
  return canvas;
}

// The dark colour is a's; b's is lighter in black and white as well. Where both have walls they darken.
const pairColours = [[0, 60, 120], [225, 120, 0]];

function drawTinted(context, viewport, map, wall, corners, redraw) {
  const level = levelFor(map.grid, 1 / map.grid.levels[0].metres_per_pixel, redraw);
  if (!level) return;
  const key = wall.join();
  level.tinted = level.tinted || {};
  level.tinted[key] = level.tinted[key] || tinted(level, wall);
  const length = level.metres_per_pixel, width = level.columns * length, height = level.rows * length;
  const [x0, y0] = corners(level.x, level.y + height), [x1, y1] = corners(level.x + width, level.y + height), [x2, y2] = corners(level.x, level.y);
  context.save();
  context.imageSmoothingEnabled = length * viewport.scale < 1.5;
  const c0 = viewport.column(x0), r0 = viewport.row(y0);
  context.transform((viewport.column(x1) - c0) / level.columns, (viewport.row(y1) - r0) / level.columns, (viewport.column(x2) - c0) / level.rows,
    (viewport.row(y2) - r0) / level.rows, c0, r0);
  context.drawImage(level.tinted[key], 0, 0);
  context.restore();
}

function drawPair(context, viewport, a, b, hypothesis, shown) {
  context.fillStyle = '#fff';
  context.fillRect(0, 0, viewport.width, viewport.height);
  context.globalCompositeOperation = 'multiply';
  const move = hypothesis ? aFromB(hypothesis.b_from_a) : besides(a, b), stay = (x, y) => [x, y], redraw = () => viewport.redraw();
  for (const [map, place, wall, on] of [[a, stay, pairColours[0], shown.a], [b, move, pairColours[1], shown.b]]) {
    if (!on) continue;
    if (map.grid) drawTinted(context, viewport, map, wall, place, redraw);
    else drawPointsFromAbove(context, viewport, map, `rgb(${wall.join(',')})`, place);
  }
  context.globalCompositeOperation = 'source-over';
  for (const [map, place, wall, dash, on] of [[a, stay, pairColours[0], [], shown.a], [b, move, pairColours[1], [5, 4], shown.b]])
    if (on && map.trajectories[0]) tracePlaced(context, viewport, map.trajectories[0], place, wall, dash);
  drawConflicts(context, viewport, hypothesis ? hypothesis.contradictions || [] : []);
  drawScaleBar(context, viewport);
}

function tracePlaced(context, viewport, trajectory, place, wall, dash) {
  const { x, y } = poses(trajectory);
  context.beginPath();
  for (let i = 0; i < x.length; ++i) {
    const [px, py] = place(x[i], y[i], 0);
    context.lineTo(viewport.column(px), viewport.row(py));
  }
  context.strokeStyle = `rgba(${wall.join(',')},.7)`;
  context.lineWidth = 1.5;
  context.setLineDash(dash);
  context.stroke();
  context.setLineDash([]);
}

// Where nothing says how they lie: beside each other.
function besides(a, b) {
  const right = a.view[2] + 2 - b.view[0];
  return (x, y) => [x + right, y];
}

function boundsOfPair(a, b, hypothesis) {
  const move = hypothesis ? aFromB(hypothesis.b_from_a) : besides(a, b), [x0, y0, x1, y1] = b.view;
  const corners = [[x0, y0], [x1, y0], [x0, y1], [x1, y1]].map(([x, y]) => move(x, y, 0));
  const xs = corners.map((corner) => corner[0]), ys = corners.map((corner) => corner[1]);
  return [Math.min(a.view[0], ...xs), Math.min(a.view[1], ...ys), Math.max(a.view[2], ...xs), Math.max(a.view[3], ...ys)];
}

function hypothesisNumbers(hypothesis, pair) {
  const parts = { lasers: [['coinciding_m', 'wall of both coincides'], ['distinctive_m', 'of it fits nowhere around'], ['contradicted_m', 'seen through by the other'],
    ['unclear_m', 'unclear'], ['by_chance_m', 'expected by chance']],
  grids: [['coinciding_m', 'wall of both coincides'], ['support_m', 'counts, by how unusual it is'], ['contradicted_m', 'in free space of the other']], cameras: [] };
  const rows = (parts[hypothesis.sense] || []).filter(([name]) => isNumber(hypothesis[name])).map(([name, text]) => [text, `${fixed(hypothesis[name], 1)} m`]);
  if (Math.abs(hypothesis.wider_m) > 0.03) rows.push([`rooms of ${hypothesis.wider_m > 0 ? pair.b : pair.a} are wider`, `${fixed(100 * Math.abs(hypothesis.wider_m), 0)} cm at least`]);
  rows.push([hypothesis.sense === 'cameras' ? 'pairs of pictures that agree' : 'places that agree', String(hypothesis.matches)]);
  if (hypothesis.sense === 'cameras') rows.push(['pairs of pictures that put them elsewhere', String(hypothesis.elsewhere)]);
  if (hypothesis.sense !== 'cameras') rows.push(['overlap', `${fixed(100 * hypothesis.overlap, 0)} %`]);
  rows.push(['probability by itself', fixed(hypothesis.probability, 3)]);
  if (hypothesis.taken_apart) rows.push(['merged so at first', 'taken apart by the audit']);
  return table(['What speaks for and against it', '#'], rows);
}

// The hypotheses of a pair as they can be drawn: as the team has it first, where that came through others.
function drawable(pair) {
  const list = (pair.hypotheses || []).map((hypothesis, index) => ({ title: `Hypothesis ${index + 1}`, hypothesis }));
  if (pair.team_b_from_a && list.length === 0) list.push({ title: 'In the team map', hypothesis: { b_from_a: pair.team_b_from_a } });
  if (pair.b_from_a && list.length === 0) list.push({ title: 'Best alignment', hypothesis: { b_from_a: pair.b_from_a } });
  return list.length > 0 ? list : [{ title: 'Beside each other', hypothesis: null }];
}

function pairPicture(pair, a, b) {
  const canvas = make('canvas', { class: 'pair-canvas', tabindex: 0, role: 'img', 'aria-label': `Maps of ${pair.a} (dark) and ${pair.b} (light) on each other` });
  const choices = drawable(pair), numbers = make('div'), shown = { a: true, b: true };
  let chosen = choices[0];
  const viewport = new Viewport(canvas, boundsOfPair(a, b, chosen.hypothesis), (context, view) => drawPair(context, view, a, b, chosen.hypothesis, shown));
  const buttons = choices.map((choice) => button(choice.title, () => choose(choice), { 'aria-pressed': 'false' }));
  function choose(choice) {
    chosen = choice;
    buttons.forEach((one, index) => one.setAttribute('aria-pressed', String(choices[index] === choice)));
    numbers.replaceChildren(...(choice.hypothesis && choice.hypothesis.sense ? [hypothesisNumbers(choice.hypothesis, pair)] : []));
    viewport.show(boundsOfPair(a, b, choice.hypothesis));
  }
  choose(chosen);
  const show = (which, text) => checkbox(text, true, (on) => {
    shown[which] = on;
    viewport.redraw();
  });
  const colour = (index) => shape('svg', { width: 24, height: 12, viewBox: '0 0 24 12', 'aria-hidden': 'true' },
    shape('rect', { width: 24, height: 12, fill: `rgb(${pairColours[index].join(',')})` }));
  const key = make('div', { class: 'key' }, make('span', {}, colour(0), ` ${pair.a} (dark)`), make('span', {}, colour(1), ` ${pair.b} (light)`), make('span', {}, 'walls of both: black'));
  return [canvas, key, make('div', { class: 'bar' }, buttons, show('a', pair.a), show('b', pair.b), zoomButtons(viewport)), numbers];
}

function pairBody(pair) {
  const a = mapOfRobot(pair.a), b = mapOfRobot(pair.b), drawn = (map) => map && (map.grid || map.points);
  const lines = [pair.words, pair.detail && `More: ${pair.detail}.`, pair.in_one_map && (pair.connected_through || []).length > 0 &&
    `In one map through ${pair.connected_through.join(', ')}.`, pair.prior && `Prior: ${pair.prior}.`, pair.helps && `What helps: ${pair.helps}.`];
  const picture = drawn(a) && drawn(b) ? pairPicture(pair, a, b) : [make('p', { class: 'soft' }, 'The maps of the two are not in this folder, so they are not drawn here.')];
  const rest = (pair.hypotheses || []).length > 0 && !(drawn(a) && drawn(b)) ? [hypothesisNumbers(pair.hypotheses[0], pair)] : [];
  return make('div', {}, lines.filter(Boolean).map((line) => make('p', {}, line)), picture, rest);
}

function pairEntry(pair) {
  const decision = decisionOf(pair);
  const entry = make('details', {}, make('summary', {}, make('span', { class: 'decision' }, `${decision.sign} ${decision.text}`), `${pair.a} + ${pair.b}`,
    make('span', { class: 'soft' }, ` · ${pair.because || pair.reason}${pair.decision === 'accepted' ? '' : pair.in_one_map ? '; in one map through others' : ''} · ${pair.tier}`)));
  let made = false;
  entry.addEventListener('toggle', () => {
    if (!entry.open || made) return;
    made = true;
    entry.append(pairBody(pair));
  });
  return entry;
}

// Robots against robots, the verdict of the highest tier in each field.
function pairMatrix(names, open) {
  const last = new Map();
  run.pairs.forEach((pair, index) => last.set(`${pair.a} ${pair.b}`, index));
  const cell = (a, b) => {
    const index = last.has(`${a} ${b}`) ? last.get(`${a} ${b}`) : last.get(`${b} ${a}`);
    if (index === undefined) return make('td', {});
    const pair = run.pairs[index], decision = decisionOf(pair);
    const sign = pair.decision !== 'accepted' && pair.in_one_map ? '·' : decision.sign;
    return make('td', {}, button(sign, () => open(index), { title: `${a} + ${b}: ${decision.text}`, 'aria-label': `${a} and ${b}: ${decision.text}` }));
  };
  const rows = names.slice(1).map((a, i) => make('tr', {}, make('th', { scope: 'row' }, a), names.slice(0, i + 1).map((b) => cell(a, b))));
  return make('div', { class: 'scroll', tabindex: 0, role: 'group', 'aria-label': 'Robots against robots' }, make('table', { class: 'matrix' },
    make('thead', {}, make('tr', {}, make('td', {}), names.slice(0, -1).map((name) => make('th', { scope: 'col' }, make('span', { class: 'upright' }, name))))), make('tbody', {}, rows)));
}

function pairsSection() {
  if (run.pairs.length === 0) return [make('p', {}, run.missing.includes('merges.json') ? 'merges.json is missing: nothing is known of pairs.' : 'No two maps were compared.')];
  const entries = run.pairs.map(pairEntry), count = (decision) => run.pairs.filter((pair) => pair.decision === decision).length;
  const names = [...new Set(run.pairs.flatMap((pair) => [pair.a, pair.b]))].sort();
  const open = (index) => {
    entries[index].hidden = false;
    entries[index].open = true;
    entries[index].scrollIntoView({ block: 'nearest' });
    entries[index].querySelector('summary').focus();
  };
  const search = make('input', { type: 'search', placeholder: 'name or reason', 'aria-label': 'Show pairs with this name or reason' });
  const kinds = ['accepted', 'refused', 'deferred'], wanted = new Set(kinds);
  const filter = () => run.pairs.forEach((pair, i) => {
    const text = `${pair.a} ${pair.b} ${pair.because} ${pair.reason}`.toLowerCase();
    entries[i].hidden = !text.includes(search.value.trim().toLowerCase()) || (kinds.includes(pair.decision) && !wanted.has(pair.decision));
  });
  search.addEventListener('input', filter);
  const boxes = kinds.map((kind) => checkbox(`${decisions[kind].sign} ${decisions[kind].text} (${count(kind)})`, true, (on) => {
    if (on) wanted.add(kind);
    else wanted.delete(kind);
    filter();
  }));
  window.addEventListener('beforeprint', () => entries.slice(0, 30).forEach((entry) => { entry.open = true; }));
  const few = names.length > 2 && names.length <= 60;
  return [make('div', { class: 'bar' }, entries.length > 3 ? search : null, boxes),
    few ? make('p', { class: 'small soft' }, '● merged, ✕ kept apart, ○ undecided, · in one map through others; empty: not compared.') : null, few ? pairMatrix(names, open) : null,
    make('div', {}, entries)].filter(Boolean);
}
