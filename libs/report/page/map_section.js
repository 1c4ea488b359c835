// The large map: layers, legend, replay.

const fewLinks = 150;  // more hide the map, and are shown when they are asked for

// Everything of a map, in the order in which it lies on each other. `shown`: which layers and robots; `stampOf`: until when.
function drawMap(context, viewport, map, shown, stampOf) {
  const redraw = () => viewport.redraw();
  if (shown.walls) drawGrid(context, viewport, map, redraw);
  else {
    context.fillStyle = '#fff';
    context.fillRect(0, 0, viewport.width, viewport.height);
  }
  if (shown.walls && !map.grid) drawPointsFromAbove(context, viewport, map);
  else if (shown.points) drawPointsFromAbove(context, viewport, map);
  if (shown.loops) drawLinks(context, viewport, map.loops, loopLook);
  if (shown.joins) drawLinks(context, viewport, map.joins, joinLook);
  const visible = map.trajectories.filter((trajectory) => !shown.hidden.has(trajectory.robot));
  for (const reference of map.references || [])
    if (shown.references && !shown.hidden.has(reference.robot)) drawTrajectory(context, viewport, reference, { colour: '#111', dash: [1, 3] }, Infinity);
  if (shown.trajectories)
    for (const trajectory of visible) drawTrajectory(context, viewport, trajectory, lookOf(trajectory.robot), stampOf(trajectory));
  if (shown.conflicts) drawConflicts(context, viewport, map.conflicts);
  const labels = new Labels(context);
  for (const trajectory of visible) {
    const look = lookOf(trajectory.robot), stamp = stampOf(trajectory), { x, y } = poses(trajectory);
    if (shown.ends) drawEnds(context, viewport, trajectory, look);
    const pose = stamp === Infinity ? null : poseAt(trajectory, stamp);
    if (pose) drawRobot(context, viewport, pose, look);
    const at = pose || (x.length > 0 && shown.ends ? { x: x[0], y: y[0] } : null);
    if (at && map.trajectories.length > 1) labels.put(nameOf(trajectory.robot), viewport.column(at.x) + 7, viewport.row(at.y) - 7, look.colour);
  }
  drawScaleBar(context, viewport);
}

function pathLength(trajectory) {
  const { x, y } = poses(trajectory);
  let length = 0;
  for (let i = 1; i < x.length; ++i) length += Math.hypot(x[i] - x[i - 1], y[i] - y[i - 1]);
  return length;
}

function symbolOf(kind) {
  const parts = {
    start: () => [shape('circle', { cx: 22, cy: 8, r: 5, fill: '#fff', stroke: '#333', 'stroke-width': 2.5 })],
    end: () => [shape('rect', { x: 17, y: 3, width: 10, height: 10, fill: '#333' })],
    loop: () => [shape('line', { x1: 6, y1: 8, x2: 38, y2: 8, stroke: loopLook.colour, 'stroke-dasharray': '2 3' }),
      ...[6, 38].map((cx) => shape('circle', { cx, cy: 8, r: 2.5, fill: loopLook.colour }))],
    join: () => [shape('line', { x1: 6, y1: 10, x2: 38, y2: 10, stroke: joinLook.colour, 'stroke-width': 1.6 }),
      ...[6, 38].map((x) => shape('path', { d: `M${x} 4l4 8h-8z`, fill: joinLook.colour }))],
    conflict: () => [shape('path', { d: 'M18 4l8 8m0-8l-8 8', stroke: '#c00000', 'stroke-width': 2 }),
      shape('circle', { cx: 22, cy: 8, r: 7, fill: 'none', stroke: '#c00000', 'stroke-width': 2 })],
    reference: () => [shape('line', { x1: 0, y1: 8, x2: 44, y2: 8, stroke: '#111', 'stroke-width': 2.2, 'stroke-dasharray': '1 3' })],
  };
  return shape('svg', { width: 44, height: 16, viewBox: '0 0 44 16', 'aria-hidden': 'true' }, parts[kind]());
}

function robotsLegend(map, shown, redraw) {
  const rows = map.trajectories.map((trajectory) => {
    const name = nameOf(trajectory.robot);
    const box = checkbox(name, !shown.hidden.has(trajectory.robot), (on) => {
      if (on) shown.hidden.delete(trajectory.robot);
      else shown.hidden.add(trajectory.robot);
      redraw();
    });
    return [box, sample(lookOf(trajectory.robot)), `${fixed(pathLength(trajectory), 1)} m`];
  });
  return rows.length > 0 ? table(['Robot', '', '#Driven'], rows) : make('p', { class: 'soft' }, 'No trajectory lies in the folder.');
}

function symbolsLegend(map) {
  const count = (links, total) => (total > links.length ? `${links.length} of ${total} drawn` : String(links.length));
  const rows = [[symbolOf('start'), 'start of a robot', ''], [symbolOf('end'), 'its end', '']];
  if (map.has_links) {
    if (map.loop_count > 0 || !map.points) rows.push([symbolOf('loop'), 'loop: a robot came back to a place', count(map.loops, map.loop_count)]);
    rows.push([symbolOf('join'), `join: a place that two robots saw${map.joins.length > fewLinks ? ' (hidden at first)' : ''}`, count(map.joins, map.join_count)]);
  }
  rows.push([symbolOf('conflict'), 'conflict: a wall that another robot saw through', String(map.conflicts.length)]);
  if ((map.references || []).length > 0) rows.push([symbolOf('reference'), 'reference', '']);
  return table(['', 'Sign', '#'], rows);
}

function mapSection() {
  const maps = run.maps.filter((map) => map.grid || map.trajectories.length > 0 || map.points);
  if (maps.length === 0) return [make('p', {}, 'There is no map in this folder that can be drawn.'), ...plainPictures()];
  const canvas = make('canvas', { class: 'map-canvas', tabindex: 0, role: 'img' });
  const legend = make('div', { class: 'legend' }), controls = make('div', { class: 'controls' }), where = make('output', { class: 'soft small' });
  const shown = { walls: true, points: false, trajectories: true, ends: true, loops: false, joins: true, conflicts: true, references: true, hidden: new Set() };
  let map = maps[0], replay = new Replay(map.trajectories), player = null, time = Infinity;
  const stampOf = (trajectory) => replay.stampOf(trajectory, time);
  const viewport = new Viewport(canvas, map.view, (context, view) => drawMap(context, view, map, shown, stampOf));
  viewport.onmove = ([x, y]) => { where.textContent = `x ${x.toFixed(2)} m, y ${y.toFixed(2)} m`; };

  function choose(index) {
    if (player) player.stop();
    map = maps[index];
    shown.hidden.clear();
    shown.joins = map.joins.length <= fewLinks;
    replay = new Replay(map.trajectories);
    time = Infinity;
    player = replayControls(replay, (now) => {
      time = now;
      viewport.redraw();
    });
    canvas.setAttribute('aria-label', `${map.title}: ${counted(map.trajectories.length, 'robot')}. Arrow keys move, plus and minus zoom, 0 shows all, space plays.`);
    const layer = (name, text) => checkbox(text, shown[name], (on) => {
      shown[name] = on;
      viewport.redraw();
    });
    const layers = [layer('walls', map.grid ? 'walls' : 'landmarks'), map.grid && map.points ? layer('points', 'landmarks') : null,
      layer('trajectories', 'trajectories'), layer('ends', 'starts and ends'), map.has_links ? [layer('loops', 'loops'), layer('joins', 'joins')] : null,
      layer('conflicts', 'conflicts'), (map.references || []).length > 0 ? layer('references', 'reference') : null].flat();
    controls.replaceChildren(make('div', { class: 'bar' }, layers, zoomButtons(viewport)), ...(map.trajectories.length > 0 ? [player.element] : []));
    legend.replaceChildren(...[robotsLegend(map, shown, () => viewport.redraw()), symbolsLegend(map), thinningNote(map)].filter(Boolean));
    viewport.show(map.view);
  }
  canvas.addEventListener('keydown', (event) => {
    const actions = { ' ': () => player.toggle(), '[': () => player.step(-1), ']': () => player.step(1) };
    if (!actions[event.key]) return;
    event.preventDefault();
    actions[event.key]();
  });
  const chooser = select('Map', maps.map((one) => one.title), choose);
  choose(0);
  mapSection.show = (title) => {
    const index = maps.findIndex((one) => one.title === title);
    if (index < 0) return;
    chooser.list.value = index;
    choose(index);
    document.getElementById('map').scrollIntoView();
  };
  const hint = make('p', { class: 'small soft hint' }, 'Drag to move; click the map first, then the wheel zooms. Keys: arrows, + and −, 0 for the whole map, space to play, [ and ] to step.');
  return [make('div', { class: 'bar' }, maps.length > 1 ? chooser.element : null, where), make('div', { class: 'beside' }, make('div', {}, canvas, controls, hint), legend),
    ...plainPictures()];
}

function thinningNote(map) {
  const finest = map.grid && map.grid.levels[map.grid.levels.length - 1];
  if (!finest) return null;
  const cells = Math.round(finest.metres_per_pixel / map.grid.resolution_m);
  return make('p', { class: 'small soft' }, `Cells of ${significant(map.grid.resolution_m * 100, 2)} cm` + (cells > 1 ? `; one pixel is ${cells} by ${cells} cells, a wall wins` : '') + '.');
}

// Pictures that no coordinates are known of.
function plainPictures() {
  return run.maps.filter((map) => map.picture).map((map) => make('figure', {}, make('img', { src: map.picture, alt: map.title, loading: 'lazy' }),
    make('figcaption', {}, `${map.title}: a picture only, since map.yaml and map.pgm are missing (output.pgm)`)));
}
