// Head, robots, errors, pictures and options of a run, and its parts from top to bottom.

const exitWords = { 0: 'done', 1: 'failed', 2: 'wrong command line', 3: 'bad or missing input', 4: 'done; some maps stayed apart', 5: 'a requested gate failed',
  130: 'interrupted; what was finished is saved' };

function outcome() {
  const teams = run.summary ? run.summary.teams : [];
  if (!run.summary) return 'summary.json is missing: this page shows what the other files hold.';
  if (run.summary.interrupted) return 'This run was interrupted. The page shows what was finished until then.';
  if (run.verb === 'slam') return run.robots.some((robot) => robot.mapped) ? 'One map of one robot.' : 'No map came of it.';
  if (teams.length === 0) return 'No map came of it.';
  const robots = counted(run.robots.length, 'robot');
  if (teams.length === 1) return teams[0].length === run.robots.length ? `One map of ${robots}.` : `One map, made of ${counted(teams[0].length, 'map')} of ${robots}.`;
  return `${teams.length} maps stayed apart: ${teams.map((team) => team.join(' + ')).join('; ')}.`;
}

function headSection() {
  const head = document.getElementById('head'), summary = run.summary || {}, facts = [];
  const add = (name, value) => facts.push([name, value]);
  const count = (decision) => run.pairs.filter((pair) => pair.decision === decision && pair.tier === 'cloud').length;
  const drivenSeconds = run.robots.reduce((sum, robot) => sum + (robot.log_seconds || 0), 0);
  add('robots', run.robots.length > 0 ? String(run.robots.length) : '');
  add('recorded', drivenSeconds > 0 ? duration(drivenSeconds) : '');
  add('took', duration(summary.wall_seconds));
  add('memory at most', summary.peak_rss_bytes > 0 ? amount(summary.peak_rss_bytes) : '');
  if (run.pairs.length > 0) {
    add('pairs merged', String(count('accepted')));
    add('kept apart', String(count('refused')));
    if (count('deferred') > 0) add('undecided', String(count('deferred')));
  }
  add('exit code', isNumber(summary.exit_code) ? `${summary.exit_code}: ${exitWords[summary.exit_code] || ''}` : '');
  head.append(make('p', { class: 'outcome' }, outcome()), factList(facts));
  const troubles = run.robots.filter((robot) => robot.trouble).map((robot) => `${robot.name}: its stream ended early: ${robot.trouble}`);
  for (const text of [...troubles, ...run.problems]) head.append(make('p', { class: 'warning' }, text));
  if (run.missing.length > 0) {
    const most = 8, more = run.missing.length - most;
    head.append(make('p', { class: 'soft small' }, `Not in the folder: ${run.missing.slice(0, most).join(', ')}${more > 0 ? ` and ${counted(more, 'more file')}` : ''}.`));
  }
  if ((summary.notes || []).length > 0)
    head.append(make('details', { open: summary.notes.length <= 4 }, make('summary', {}, counted(summary.notes.length, 'note')), make('div', {}, make('ul', {}, summary.notes.map((note) => make('li', {}, note))))));
}

function robotFigure(map) {
  const canvas = make('canvas', { role: 'img', 'aria-label': map.title });
  const shown = { walls: true, trajectories: true, ends: true, conflicts: true, loops: false, joins: false, hidden: new Set() };
  whenSeen(canvas, () => new Viewport(canvas, map.view, (context, view) => drawMap(context, view, map, shown, () => Infinity)));
  const inLarge = button('in the large map', () => mapSection.show(map.title), { class: 'controls' });
  return make('figure', {}, canvas, make('figcaption', {}, map.title, ' ', mapSection.show ? inLarge : null));
}

function cameraRows() {
  return run.robots.flatMap((robot) => (robot.cameras || []).map((camera) => [robot.name, camera.label, camera.kind, String(camera.frames), String(camera.tracked),
    String(camera.lost), String(camera.keyframes), String(camera.landmarks), String(camera.loops), fixed(camera.tracking_mean_ms, 1)]));
}

function robotsSection() {
  if (run.robots.length === 0) return [make('p', {}, 'No robot is known.')];
  const team = (name) => {
    const index = run.summary ? run.summary.teams.findIndex((members) => members.includes(name)) : -1;
    const hasMain = run.maps.some((one) => one.name === 'team');
    return index < 0 ? '' : index === 0 && hasMain ? 'team' : `team-${hasMain ? index : index + 1}`;
  };
  const rows = run.robots.map((robot, index) => {
    const map = mapOfRobot(robot.name) || run.maps.find((one) => one.trajectories.some((trajectory) => trajectory.robot === index));
    const trajectory = map && map.trajectories.find((one) => one.robot === index);
    const state = robot.trouble ? 'ended early' : robot.mapped === false ? (robot.scans === 0 && (robot.cameras || []).length === 0 ? 'no scans, no map' : 'no map') : 'mapped';
    return [make('span', {}, sample(lookOf(index)), ' ', robot.name), state, robot.edge || '', team(robot.name), isNumber(robot.scans) ? String(robot.scans) : '', duration(robot.log_seconds),
      duration(robot.wall_seconds), duration(robot.cpu_seconds), robot.wall_seconds > 0 ? `${significant(robot.log_seconds / robot.wall_seconds, 2)} ×` : '', trajectory ? `${fixed(pathLength(trajectory), 1)} m` : ''];
  });
  const cameras = cameraRows(), figures = run.maps.length < 2 ? [] : run.maps.filter((map) => map.kind === 'robot' && (map.grid || map.trajectories.length > 0 || map.points));
  return [table(['Robot', 'State', 'Edge', 'In', '#Scans', '#Recorded', '#Took', '#Processor', '#Real time', '#Driven'], rows),
    cameras.length > 0 ? [make('h3', {}, 'Cameras'), table(['Robot', 'Camera', 'Kind', '#Frames', '#Tracked', '#Lost', '#Keyframes', '#Landmarks', '#Loops', '#ms a frame'], cameras)] : [],
    figures.length > 0 ? [make('h3', {}, 'Each robot’s map'), make('div', { class: 'figures' }, figures.map(robotFigure))] : []].flat(2);
}

function errorsSection() {
  if (run.errors.length === 0) return null;
  const rows = run.errors.map((error) => (error.problem ? [error.robot, error.problem, '', '', '', '', ''] : [error.robot, `${error.pairs} of ${error.poses} poses (${fixed(100 * error.pairs / Math.max(error.poses, 1), 0)} %)`,
    significant(error.ate_rmse_m), significant(error.ate_median_m), significant(error.ate_max_m), significant(error.rpe_rmse_m), significant(error.rpe_rmse_deg)]));
  const series = run.errors.filter((error) => error.t_ms && error.t_ms.length > 1).map((error) => {
    let t = 0;
    return { name: error.robot, look: lookOf(run.robots.findIndex((robot) => robot.name === error.robot)), x: error.t_ms.map((step) => (t += step) / 1000), y: error.off_mm.map((off) => off / 1000) };
  });
  const legend = make('div', { class: 'key' }, series.map((one) => make('span', {}, sample(one.look), ' ', one.name)));
  return [make('p', {}, run.alignment), table(['Robot', 'Compared with the reference', '#ATE RMSE, m', '#Median, m', '#Largest, m', '#RPE, m a pose', '#RPE, degrees'], rows),
    ...(series.length > 0 ? [make('h3', {}, 'Error of the position over time'), lineChart(series, 'seconds since the robot’s first compared pose', 'metres'), legend] : [])];
}

function picturesSection() {
  const figures = run.pictures.map((picture) => make('figure', {}, make('img', { src: picture.image, alt: picture.title, loading: 'lazy', decoding: 'async' }), make('figcaption', {}, picture.title)));
  return figures.length > 0 ? figures : null;
}

function optionsSection() {
  if (run.missing.includes('config.yaml')) return [make('p', {}, 'config.yaml is missing: the options are not known.')];
  if (run.options.length === 0) return [make('p', {}, 'All options have their defaults.')];
  return [table(['Option', 'Value', 'Default'], run.options.map((option) => [make('code', {}, option.name), make('code', {}, option.value), make('code', {}, option.default)]))];
}

const drawHead = headSection;
const pageParts = [{ id: 'map', title: 'Map', build: mapSection }, { id: 'robots', title: 'Robots', build: robotsSection },
  { id: 'pairs', title: 'Pairs', build: () => (run.verb === 'slam' ? null : pairsSection()) }, { id: 'errors', title: 'Errors', build: errorsSection },
  { id: 'timeline', title: 'Timeline', build: timelineSection }, { id: 'points', title: 'Points in space', build: pointsSection },
  { id: 'pictures', title: 'Pictures', build: picturesSection },
  { id: 'options', title: 'Options', heading: 'Options that differ from the defaults', build: optionsSection },
  { id: 'again', title: 'Make it again', build: () => againSection('the same maps, byte for byte, on any number of threads') }];
