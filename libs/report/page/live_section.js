// A program that runs: its maps so far, robots, who speaks with whom, counts, findings; drawn anew with every event.

const roleOf = (tier) => (tier.role === tier.name ? tier.name : `${tier.role} ${tier.name}`);
const live = { receivedAt: Date.now(), connected: true, ended: false, fetching: false, redraws: [] };

// Makes `old` look like `fresh` with few changes: focus, selections and scrolled tables stay.
function morph(old, fresh) {
  if (old.nodeType !== fresh.nodeType || old.nodeName !== fresh.nodeName) return old.replaceWith(fresh);
  if (old.nodeType === Node.TEXT_NODE) {
    if (old.data !== fresh.data) old.data = fresh.data;
    return undefined;
  }
  for (const { name } of [...old.attributes]) if (!fresh.hasAttribute(name)) old.removeAttribute(name);
  for (const { name, value } of fresh.attributes) if (old.getAttribute(name) !== value) old.setAttribute(name, value);
  const to = [...old.childNodes], from = [...fresh.childNodes];
  from.forEach((child, i) => (to[i] ? morph(to[i], child) : old.append(child)));
  for (const child of to.slice(from.length)) child.remove();
  return undefined;
}

// What `draw` returns, drawn again whenever something new is known.
function redrawn(draw) {
  const place = make('div', {});
  const again = () => morph(place, filled(make('div', {}), {}, attempted(draw)));
  live.redraws.push(again);
  again();
  return [place];
}
function redrawAll() {
  for (const redraw of live.redraws) redraw();
}

const tiers = () => run.status.tiers;
const agoText = (seconds) => (isNumber(seconds) ? (seconds < 10 ? `${fixed(seconds, 1)} s ago` : `${duration(seconds)} ago`) : 'never');

// --- The head, and what is wrong.

function connectionText() {
  if (live.ended) return 'The program has ended; this is what it said at last.';
  const silent = (Date.now() - live.receivedAt) / 1000;
  if (live.connected && silent < 5) return `Live: what is new comes by itself. The program runs for ${duration(Math.round(run.status.up_seconds))}.`;
  return `The program does not answer since ${duration(Math.round(silent))}; this page asks again. Below is what it said then.`;
}

function liveHead() {
  return redrawn(() => [make('p', { class: 'outcome' }, headline()), make('p', { class: live.connected || live.ended ? 'soft' : 'warning' }, connectionText()),
    ...run.status.problems.map((problem) => make('p', { class: 'warning' }, problem))]);
}

const mainTier = () => tiers().find((tier) => tier.role === 'cloud') || tiers()[0];
function headline() {
  const tier = mainTier();
  if (tier.role === 'coordinator') return `${roleOf(tier)}: ${tier.state}${tier.counts.plan ? `; plan ${tier.counts.plan}` : ''}.`;
  const groups = tier.joint.map((members) => members.join(' + '));
  const shown = run.maps.length === 0 ? 'no map to show yet' : groups.length === 0 ? `${counted(run.maps.length, 'map')}, none joined yet` : `joined: ${groups.join(', ')}`;
  return `${roleOf(tier)}: ${tier.state}; ${shown}.`;
}

function findingsSection() {
  return redrawn(() => {
    const rows = tiers().flatMap((tier) => tier.findings.map((one) => [one.level, roleOf(tier), one.what, one.remedy]));
    return rows.length === 0 ? [make('p', {}, 'Nothing is wrong.')] : [table(['', 'Who says so', 'What', 'What helps'], rows)];
  });
}

// --- Maps.

const lastStamp = (trajectory) => {
  const { t } = poses(trajectory);
  return t.length > 0 ? t[t.length - 1] : Infinity;
};

// Drawings that stay while their maps change: the largest map large, others beside each other below.
function liveMapSection() {
  const place = make('div', {}), shown = { walls: true, trajectories: true, ends: false, conflicts: false, loops: false, joins: true, hidden: new Set() };
  let drawings = [];
  const drawingOf = (index) => {
    const drawing = { map: run.maps[index], caption: make('figcaption', {}) };
    const canvas = make('canvas', { class: index === 0 ? 'map-canvas' : null, tabindex: 0, role: 'img' });
    drawing.viewport = new Viewport(canvas, drawing.map.view, (context, view) => drawMap(context, view, drawing.map, shown, lastStamp));
    drawing.figure = make('figure', {}, canvas, drawing.caption);
    drawing.canvas = canvas;
    return drawing;
  };
  const layer = (name) => checkbox(name, shown[name], (on) => {
    shown[name] = on;
    for (const drawing of drawings) drawing.viewport.redraw();
  });
  const bar = make('div', { class: 'bar' }, layer('walls'), layer('trajectories'), layer('loops'), layer('joins'),
    [['+', 1.4, 'Zoom in'], ['−', 1 / 1.4, 'Zoom out']].map(([text, factor, label]) => button(text, () => drawings[0].viewport.zoom(factor), { 'aria-label': label })),
    button('Whole map', () => drawings[0].viewport.fit()));
  function arrange() {
    drawings = run.maps.map((_, index) => drawingOf(index));
    place.replaceChildren(...(drawings.length === 0 ? [make('p', {}, 'There is no map yet: the first one comes with the first preview.')] :
      [drawings[0].figure, bar, make('div', { class: 'figures' }, drawings.slice(1).map((drawing) => drawing.figure)),
        make('p', { class: 'small soft hint' }, 'Arrows are robots, where the last preview has them; straight lines are joins: places that two robots saw. Drag to move; click the map first, then the wheel zooms. Keys: arrows, + and −, 0 for the whole map.')]));
  }
  live.mapsChanged = () => {
    if (drawings.length !== run.maps.length || drawings.length === 0) arrange();
    drawings.forEach((drawing, index) => {
      drawing.map = run.maps[index];
      drawing.viewport.bounds = drawing.map.view;
      drawing.caption.textContent = drawing.map.title;
      drawing.canvas.setAttribute('aria-label', `Map of ${drawing.map.title}`);
      if (drawing.viewport.fitted) drawing.viewport.fit();
      else drawing.viewport.redraw();
    });
  };
  live.mapsChanged();
  return [place];
}

// The pictures of the new maps are decoded before they take the place of the old ones, so that nothing flickers.
async function takeMaps(number) {
  if (live.fetching || number === run.number) return;
  live.fetching = true;
  try {
    const news = await (await fetch('maps.json')).json();
    await Promise.all(news.maps.filter((map) => map.grid).map(async (map) => {
      const [level] = map.grid.levels;
      level.image = new Image();
      level.image.src = level.png;
      await level.image.decode();
      level.ready = true;
    }));
    run.maps = news.maps;
    run.number = news.number;
    live.mapsChanged();
    redrawAll();
  } catch {  // the next event asks again
  } finally {
    live.fetching = false;
  }
}

// --- Robots, links, counts.

function robotsSection() {
  return redrawn(() => {
    const known = tiers().flatMap((tier) => tier.links.filter((link) => link.role === 'robot').map((link) => ({ tier, link })));
    const isEdge = tiers().every((tier) => tier.role === 'edge');  // which knows its own robots alone
    const rows = run.robots.map(({ name }, index) => {
      const at = known.find(({ link }) => link.name === name), itself = tiers().find((tier) => tier.role === 'robot' && tier.name === name);
      const map = run.maps.find((one) => one.trajectories.some((trajectory) => trajectory.robot === index));
      const path = map && poses(map.trajectories.find((trajectory) => trajectory.robot === index)), last = path ? path.x.length - 1 : -1;
      if (isEdge && !at) return null;
      const state = itself ? itself.state : !at ? '' : !at.link.is_needed ? 'has ended' : at.link.is_on_wire ? 'on the wire' : 'not on the wire';
      return [make('span', {}, sample(lookOf(index)), ' ', name), state, at ? at.link.edge ?? at.tier.name : '', at ? String(at.link.counts.scans) : '',
        at ? amount(at.link.counts.queue_bytes) : '', itself ? amount(itself.counts.waiting_bytes) : '', map ? map.title : '', last >= 0 ? `${fixed(path.x[last], 1)}, ${fixed(path.y[last], 1)}` : ''];
    }).filter((row) => row !== null);
    const heads = ['Robot', 'State', 'Edge', '#Scans mapped', '#Waits to be mapped', '#Waits to be sent', 'In the map of', '#Last at x, y, m'];
    const used = heads.map((_, i) => i).filter((i) => i === 0 || rows.some((row) => row[i] !== ''));
    return [table(used.map((i) => heads[i]), rows.map((row) => used.map((i) => row[i])))];
  });
}

function linksSection() {
  return redrawn(() => [table(['Who', 'Speaks with', 'On the wire', '#Last received', '#Messages', '#Stored'],
    tiers().flatMap((tier) => tier.links.map((link) => [roleOf(tier), roleOf(link), link.is_on_wire ? 'yes' : link.is_needed ? make('strong', {}, 'no') : 'no; nothing is awaited',
      agoText(link.silent_seconds), String(link.counts.taken ?? ''), String(link.counts.stored ?? '')])))]);
}

// Of a coordinator: which robots each edge has, and what is known of it.
function planSection() {
  return redrawn(() => {
    const [tier] = tiers();
    const rows = tier.links.filter((link) => link.role === 'edge').map((link) => [link.name, (tier.groups[link.name] ?? []).join(', ') || 'none',
      `${fixed(link.counts.speed, 2)} (${link.speed_is})`, link.bytes_per_second_is === 'configured' && link.counts.bytes_per_second >= 1e12 ? 'no bound (configured)' : `${amount(link.counts.bytes_per_second)}/s (${link.bytes_per_second_is})`]);
    const { expected_seconds: expected, actual_seconds: actual } = tier.counts;
    const took = `Mapping all and merging takes ${duration(expected)}, as expected${isNumber(actual) ? `; it took ${duration(actual)}` : ''}.`;
    return [table(['Edge', 'Its robots', 'Speed', 'To the cloud'], rows), make('p', {}, took), ...(tier.last ? [make('p', {}, `Moved last ${tier.last}.`)] : [])];
  });
}

function joinsSection() {
  return redrawn(() => {
    const rows = tiers().flatMap((tier) => tier.joint.map((members) => [roleOf(tier), members.join(' + ')]));
    return [rows.length === 0 ? make('p', {}, 'No maps are joined yet.') : table(['Who joined them', 'Maps that are one in the last preview'], rows)];
  });
}

const wordsOf = (key) => key.replaceAll('_', ' ').replace(' bytes', '').replace(' seconds', '');
const valueOf = (key, value) => (key.endsWith('bytes') ? amount(value) : key.endsWith('seconds') ? duration(value) : String(value));
function countsSection() {
  const facts = (counts) => factList(Object.entries(counts).map(([key, value]) => [wordsOf(key), valueOf(key, value)]));
  return redrawn(() => [...tiers().flatMap((tier) => [make('h3', {}, `${roleOf(tier)}: ${tier.state}`), facts(tier.counts)]),
    make('h3', {}, 'This process'), facts(run.status.process)]);
}

// --- Events.

function listen() {
  const source = new EventSource('events');
  source.addEventListener('status', (event) => {
    const news = JSON.parse(event.data);
    run.status = news.status;
    Object.assign(live, { receivedAt: Date.now(), connected: true });
    redrawAll();
    if ('maps' in news) takeMaps(news.maps);  // not with the last event: nobody could be asked for them
  });
  source.addEventListener('end', () => {
    source.close();
    live.ended = true;
    redrawAll();
  });
  source.addEventListener('error', () => {
    live.connected = false;
    redrawAll();
    if (source.readyState === EventSource.CLOSED && !live.ended) setTimeout(listen, 5000);  // refused: too many look already
  });
}
window.addEventListener('load', () => {
  listen();
  setInterval(() => !live.ended && Date.now() - live.receivedAt > 5000 && redrawAll(), 1000);
});

const drawHead = liveHead;
const isCoordinator = tiers().every((tier) => tier.role === 'coordinator');  // which has no map
const pageParts = [isCoordinator ? { id: 'plan', title: 'Plan', build: planSection } : { id: 'map', title: 'Map so far', build: liveMapSection },
  { id: 'findings', title: 'Findings', build: findingsSection }, { id: 'robots', title: 'Robots', build: robotsSection },
  ...(isCoordinator ? [] : [{ id: 'joins', title: 'Joins', build: joinsSection }]),
  { id: 'links', title: 'Links', build: linksSection }, { id: 'counts', title: 'Counts', build: countsSection }];
