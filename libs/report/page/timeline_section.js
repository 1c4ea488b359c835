// Who computed what when, bytes on each link, memory, what the coordinator decided.

// Bars of a robot: it packs and sends and its edge maps; or it maps and sends.
function robotBars(robot, mode) {
  const offloads = mode === 'offload' && robot.edge !== '';
  if (offloads)
    return [{ kind: 'packing', from: 0, to: robot.packed_seconds }, { kind: 'sending', from: robot.packed_seconds, to: robot.arrived_seconds },
      { kind: 'mapping', from: robot.arrived_seconds, to: robot.mapped_seconds }];
  return [{ kind: 'mapping', from: 0, to: robot.mapped_seconds }, { kind: 'sending', from: robot.mapped_seconds, to: robot.arrived_seconds }];
}

function edgeBars(edge) {
  const bars = [{ kind: 'waiting', from: 0, to: edge.ready_seconds }, { kind: 'fusing', from: edge.ready_seconds, to: edge.fused_seconds },
    { kind: 'sending', from: edge.fused_seconds, to: edge.arrived_seconds }];
  if (edge.judged_seconds > 0) bars.push({ kind: 'judging', from: Math.max(edge.fused_seconds, edge.judged_seconds - edge.judging_cpu_seconds / (edge.speed || 1)), to: edge.judged_seconds });
  return bars;
}

function timelineChart(timeline) {
  const rows = timeline.robots.map((robot) => ({ name: robot.edge && timeline.mode === 'offload' ? `${robot.id} (on ${robot.edge})` : robot.id, bars: robotBars(robot, timeline.mode) }));
  for (const edge of timeline.edges) rows.push({ name: `edge ${edge.id}`, bars: edgeBars(edge) });
  const cloudStart = Math.max(0, timeline.total_seconds - (timeline.cloud.fusing_cpu_seconds || 0));
  rows.push({ name: 'cloud', bars: [{ kind: 'waiting', from: 0, to: cloudStart }, { kind: 'fusing', from: cloudStart, to: timeline.total_seconds }] });
  for (const push of timeline.pushes || []) rows.push({ name: `map to ${push.robot}`, bars: [{ kind: 'sending', from: timeline.total_seconds, to: push.arrived_seconds }] });
  return ganttChart(rows, 'seconds since the recordings ended');
}

function linkRows(timeline) {
  const rows = [], add = (from, to, what, bytes) => { if (bytes > 0) rows.push({ from, to, what, bytes }); };
  const offload = timeline.mode === 'offload', alone = timeline.mode === 'cloud-only';
  for (const robot of timeline.robots) {
    const goal = robot.edge === '' || alone ? 'cloud' : robot.edge;
    if (offload && robot.edge !== '') add(robot.id, goal, 'what it sensed', robot.sensed_bytes);
    else add(robot.id, goal, 'its map', robot.map_bytes);
  }
  for (const edge of timeline.edges) {
    add(edge.id, 'cloud', 'maps and what it found of them', edge.bytes);
    add('cloud', edge.id, 'submaps of other edges, to compare', edge.lent_bytes);
    add(edge.id, 'cloud', 'judgements', edge.judged_bytes);
  }
  for (const push of timeline.pushes || []) add('cloud', push.robot, 'the team map', push.bytes);
  for (const robot of run.robots)
    for (const camera of robot.cameras || []) {
      add(`${robot.name}, ${camera.label}`, robot.edge || 'its camera map server', 'camera map, while it drove', camera.sent_bytes);
      add(robot.edge || 'its camera map server', `${robot.name}, ${camera.label}`, 'shared landmarks', camera.heard_bytes);
    }
  return rows;
}

// The stages that matter; those below a hundredth of the longest one are folded away.
function stageTable() {
  const most = Math.max(0, ...run.stages.map((stage) => stage.seconds));
  const stages = run.stages.filter((stage) => stage.seconds > 0), short = stages.filter((stage) => stage.seconds < 0.01 * most);
  if (stages.length === 0) return [];
  const rows = (list) => table(['Tier', 'Stage', '#Time', ''], list.map((stage) => [stage.tier || 'program', stage.name, duration(stage.seconds), amountBar(stage.seconds, most)]));
  return [make('h3', {}, 'Measured on this machine'), rows(stages.filter((stage) => !short.includes(stage))),
    short.length > 0 ? make('details', {}, make('summary', {}, counted(short.length, 'shorter stage')), make('div', {}, rows(short))) : null];
}

function coordinatorTable() {
  const decisions = run.coordinator ? run.coordinator.decisions || [] : [];
  if (decisions.length === 0) return [];
  const rows = decisions.map((decision) => [duration(decision.at_seconds), (decision.because || []).join(', '),
    decision.moves.map((move) => `${move.robot} from ${move.from || 'itself'} to ${move.to || 'itself'}`).join('; ') || 'no move', duration(decision.expected_seconds),
    duration(decision.staying_seconds)]);
  return [make('h3', {}, `Coordinator (${run.coordinator.method})`), table(['At', 'Because', 'Moves', '#Expected', '#By staying'], rows)];
}

function timelineSection() {
  const parts = [];
  if (run.timeline) {
    parts.push(make('p', {}, `Had each tier been a machine of its own (${run.timeline.mode}), the team map would have been there ${duration(run.timeline.total_seconds)} after the recordings ended.`),
      timelineChart(run.timeline));
    const links = linkRows(run.timeline), most = Math.max(0, ...links.map((link) => link.bytes));
    if (links.length > 0) parts.push(make('h3', {}, 'Bytes on each link'),
      table(['From', 'To', 'What', '#Bytes', ''], links.map((link) => [link.from, link.to, link.what, amount(link.bytes), amountBar(link.bytes, most)])));
  } else if (run.verb === 'run') parts.push(make('p', {}, 'There is no timeline: the run was interrupted, or summary.json is missing.'));
  parts.push(...coordinatorTable(), ...stageTable());
  if (run.summary && run.summary.peak_rss_bytes > 0) parts.push(make('h3', {}, 'Memory'), make('p', {}, `The program took at most ${amount(run.summary.peak_rss_bytes)}.`));
  return parts.length > 0 ? parts : [make('p', {}, 'summary.json is missing: no times are known.')];
}
