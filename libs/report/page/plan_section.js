// A plan: robots and what their maps share as a graph, predicted times, loads and links, bound and method.

const methodWords = { default: 'tabu search on coarsened graphs for groups of small cut, each group on the edge that is best for all', recslam: 'RecSLAM’s algorithms as printed',
  greedy: 'groups grown greedily, on edges in the order of their room', random: 'random groups, on edges in the order of their room', metis: 'groups of METIS, each on the edge that is best for all',
  exact: 'groups of the least cut there is, each on the edge that is best for all' };
const shortened = (text, most) => ([...text].length > most ? [...text].slice(0, most - 1).join('') + '…' : text);
const aboveBound = () => (run.lower_bound_seconds > 0 ? 100 * (run.predicted_seconds / run.lower_bound_seconds - 1) : NaN);

function planHead() {
  const used = new Set(run.robots.map((robot) => robot.edge)).size;
  return [make('p', { class: 'outcome' }, `The map of all ${duration(run.predicted_seconds)} after the recordings end, as predicted: ${counted(run.robots.length, 'robot')} on ${used} of ${counted(run.edges.length, 'edge')}.`),
    factList([['robots', String(run.robots.length)], ['overlaps', String(run.overlap_count)], ['edges', String(run.edges.length)], ['predicted', duration(run.predicted_seconds)],
      ['no plan is below', duration(run.lower_bound_seconds)], ['overlap in groups', significant(run.in_group_weight)], ['cut', significant(run.cut_weight)], ['method', run.method]])];
}

// Each edge's robots on a circle of their own, the circles on a ring.
function placedRobots() {
  const groups = run.edges.map((_, edge) => run.robots.map((_, i) => i).filter((i) => run.robots[i].edge === edge)).map((members, edge) => ({ members, edge })).filter((group) => group.members.length > 0);
  const apart = run.robots.length > 80 ? 12 : 26, gap = run.robots.length > 80 ? 20 : 110;
  for (const group of groups) group.radius = Math.max(48, group.members.length * apart / (2 * Math.PI));
  const sum = groups.reduce((total, group) => total + group.radius + gap, 0), half = (group) => Math.PI * (group.radius + gap) / sum;
  const ring = groups.length < 2 ? 0 : Math.max(...groups.map((group) => (group.radius + gap / 2) / Math.sin(Math.min(half(group), Math.PI / 2))));
  const places = [];
  let angle = -Math.PI / 2 - (groups.length > 0 ? half(groups[0]) : 0);
  for (const group of groups) {
    angle += half(group);
    group.x = ring * Math.cos(angle);
    group.y = ring * Math.sin(angle);
    angle += half(group);
    group.members.forEach((robot, i) => {
      const at = 2 * Math.PI * i / group.members.length - Math.PI / 2;
      places[robot] = { x: group.x + group.radius * Math.cos(at), y: group.y + group.radius * Math.sin(at), at };
    });
  }
  return { groups, places };
}

function robotText(robot, place, size) {
  const right = Math.cos(place.at), text = shape('text', { x: place.x + 12 * right, y: place.y + 12 * Math.sin(place.at) + 4, 'text-anchor': right > 0.3 ? 'start' : right < -0.3 ? 'end' : 'middle', class: 'halo' }, shortened(robot.name, 14));
  text.style.fontSize = `${size}px`;
  if (Math.abs(right) <= 0.3) text.setAttribute('y', place.y + (place.at < 0 || place.at > Math.PI ? -12 : 20));
  return text;
}

function planGraph() {
  const { groups, places } = placedRobots(), margin = 130;
  const xs = groups.flatMap((group) => [group.x - group.radius - margin, group.x + group.radius + margin]), ys = groups.flatMap((group) => [group.y - group.radius - 40, group.y + group.radius + 40]);
  const left = Math.min(...xs), top = Math.min(...ys), wide = Math.max(...xs) - left, high = Math.max(...ys) - top, most = run.overlaps.length > 0 ? run.overlaps[0][2] : 1;
  const scale = Math.min(1, 900 / wide);
  const chart = shape('svg', { class: 'chart graph', viewBox: [left, top, wide, high].map((value) => value.toFixed(1)).join(' '), width: Math.round(wide * scale), height: Math.round(high * scale), role: 'img', 'aria-label': 'Robots by edge, and what their maps share' });
  for (const [a, b, degree] of [...run.overlaps].reverse()) {
    const inside = run.robots[a].edge === run.robots[b].edge;
    const line = shape('line', { x1: places[a].x.toFixed(1), y1: places[a].y.toFixed(1), x2: places[b].x.toFixed(1), y2: places[b].y.toFixed(1), class: inside ? 'inside' : 'across', 'stroke-width': (0.8 + 5 * degree / most).toFixed(2) });
    line.append(shape('title', {}, `${run.robots[a].name} and ${run.robots[b].name}: ${significant(degree)}, ${inside ? 'on one edge' : 'on two edges'}`));
    chart.append(line);
  }
  run.robots.forEach((robot, i) => {
    const node = sign(robot.edge, places[i].x, places[i].y, Math.max(6, 3 / scale));
    node.append(shape('title', {}, `${robot.name} on ${run.edges[robot.edge].name}${robot.further ? `, also on ${robot.further.map((edge) => run.edges[edge].name).join(', ')}` : ''}`));
    chart.append(node);
    if (run.robots.length <= 80) chart.append(robotText(robot, places[i], Math.min(12 / scale, 20)));
  });
  for (const group of groups) {
    const text = shape('text', { x: group.x, y: group.y + 5 / scale, 'text-anchor': 'middle', class: 'halo edge' }, shortened(run.edges[group.edge].name, 12));
    text.style.fontSize = `${13 / scale}px`;
    chart.append(text);
  }
  return chart;
}

const edgeName = (edge) => make('span', {}, signSample(edge), ' ', run.edges[edge].name);
const folded = (rows, most, text, content) => (rows.length <= most ? content : make('details', {}, make('summary', {}, text), make('div', {}, content)));

function groupsSection() {
  const line = (kind) => shape('svg', { width: 44, height: 14, viewBox: '0 0 44 14', class: 'graph', 'aria-hidden': 'true' }, shape('line', { x1: 0, y1: 7, x2: 44, y2: 7, class: kind, 'stroke-width': 3 }));
  const used = run.edges.map((_, edge) => edge).filter((edge) => run.robots.some((robot) => robot.edge === edge));
  const rows = run.overlaps.slice(0, 500).map(([a, b, degree]) => [run.robots[a].name, run.robots[b].name, significant(degree), run.robots[a].edge === run.robots[b].edge ? 'one edge' : 'two edges']);
  const left = run.overlap_count - run.overlaps.length;
  return [make('div', { class: 'scroll', tabindex: 0, role: 'group', 'aria-label': 'Graph' }, planGraph()),
    make('div', { class: 'key' }, used.map(edgeName), make('span', {}, line('inside'), ' overlap within an edge'), make('span', {}, line('across'), ' overlap across edges: the cloud joins it')),
    make('p', { class: 'soft small' }, `The wider a line, the more two maps share.${left > 0 ? ` The ${run.overlaps.length} largest of ${run.overlap_count} overlaps are drawn.` : ''}`),
    rows.length > 0 ? make('details', {}, make('summary', {}, rows.length < run.overlap_count ? `The ${rows.length} largest overlaps` : counted(rows.length, 'overlap')), make('div', {}, table(['Robot', 'Robot', '#Degree', 'On'], rows))) : make('p', {}, 'No maps overlap.')];
}

function timesSection() {
  const most = 60, robots = run.timeline.robots;
  const last = robots.map((_, i) => i).sort((a, b) => robots[b].mapped_seconds - robots[a].mapped_seconds || a - b).slice(0, most).sort((a, b) => a - b);
  return [make('p', {}, 'A robot packs what it sensed and sends it to its edge, which maps it. An edge waits for its last robot, fuses its robots’ maps and sends them; the cloud waits for the last edge.'),
    robots.length > most ? make('p', { class: 'soft small' }, `The ${most} robots that are mapped last, of ${robots.length}.`) : null, timelineChart({ ...run.timeline, robots: last.map((i) => robots[i]) })].filter(Boolean);
}

function loadsSection() {
  const busy = run.edges.map((edge) => edge.computing_seconds), longest = Math.max(0, ...busy);
  const edges = run.edges.map((edge, i) => [edgeName(i), `${edge.robots}${isNumber(edge.capacity) ? ` of ${edge.capacity}` : ''}`, String(Math.round(edge.scans)), significant(edge.speed), duration(edge.computing_seconds), amountBar(edge.computing_seconds, longest),
    amount(edge.bytes), `${amount(edge.bytes_per_s)}/s`, duration(edge.delay_s), duration(edge.sending_seconds)]);
  const wires = run.timeline.robots.map((robot) => [robot.id, robot.edge, amount(robot.sensed_bytes), `${amount(robot.bytes_per_s)}/s`, duration(robot.delay_s), duration(robot.arrived_seconds - robot.packed_seconds), duration(robot.mapped_seconds)]);
  return [make('h3', {}, 'Edges, and their links to the cloud'), table(['Edge', '#Robots', '#Scans', '#Speed', '#Map ready after', '', '#Sends', '#Bandwidth', '#Delay', '#Takes'], edges),
    make('h3', {}, 'Robots, and their links to edges'), folded(wires, 40, counted(wires.length, 'link'), table(['Robot', 'Edge', '#Sends', '#Bandwidth', '#Delay', '#Takes', '#Mapped after'], wires)),
    make('p', { class: 'soft small' }, `The cloud has speed ${significant(run.cloud.speed)}; what lies on two edges is compared ${run.cloud.edges_judge ? 'by the edges' : 'in the cloud'}.`)];
}

function methodSection() {
  const most = Math.max(run.predicted_seconds, run.lower_bound_seconds), above = aboveBound();
  return [make('p', {}, `${run.method}: ${methodWords[run.method] || ''}.${run.edges_per_robot > 1 ? ` Each robot sends its data to ${run.edges_per_robot} edges.` : ''}`),
    table(['What', '#Time', ''], [['this plan, as predicted', duration(run.predicted_seconds), amountBar(run.predicted_seconds, most)], ['no plan is below', duration(run.lower_bound_seconds), amountBar(run.lower_bound_seconds, most)]]),
    make('p', {}, isNumber(above) ? `The plan is at most ${significant(above, 2)} % slower than the best one. The bound divides robots between edges, and edges share all their bandwidth, so that no plan may reach it.` : 'The bound says nothing here.')];
}

const drawHead = planHead;
const pageParts = [{ id: 'groups', title: 'Groups', build: groupsSection }, { id: 'times', title: 'Predicted times', build: timesSection },
  { id: 'loads', title: 'Loads and links', build: loadsSection }, { id: 'method', title: 'Bound and method', build: methodSection },
  { id: 'again', title: 'Make it again', build: () => againSection('the same plan') }];
