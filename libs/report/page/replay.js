// Time of a replay: seconds since the first pose, with pauses of all robots left out; or all robots from their starts.

class Replay {
  constructor(trajectories) {
    this.spans = trajectories.filter((trajectory) => trajectory.t_ms.length > 0).map((trajectory) => {
      const { t } = poses(trajectory);
      return { trajectory, first: t[0], last: t[t.length - 1] };
    });
    this.together = false;
    this.arrange();
  }

  // Pauses longer than this are left out.
  arrange() {
    const longestPause = 30, sorted = [...this.spans].sort((a, b) => a.first - b.first);
    this.pieces = [];  // [first stamp, last stamp, seconds of the replay at the first]
    this.length = 0;
    for (const span of this.together ? [] : sorted) {
      const piece = this.pieces[this.pieces.length - 1];
      if (piece && span.first <= piece[1] + longestPause) piece[1] = Math.max(piece[1], span.last);
      else this.pieces.push([span.first, span.last, 0]);
    }
    for (const piece of this.pieces) {
      piece[2] = this.length;
      this.length += piece[1] - piece[0];
    }
    if (this.together) this.length = Math.max(0, ...this.spans.map((span) => span.last - span.first));
  }

  // The stamp that a robot's trajectory shows at a time of the replay.
  stampOf(trajectory, time) {
    if (time >= this.length) return Infinity;
    if (this.together) {
      const span = this.spans.find((one) => one.trajectory === trajectory);
      return span ? span.first + time : Infinity;
    }
    const piece = this.pieces.findLast((one) => one[2] <= time) || this.pieces[0];
    return piece[0] + time - piece[2];
  }
}

// Slider, play button and speed. `show(time)` draws; time is replay.length at the end.
function replayControls(replay, show) {
  const slider = make('input', { type: 'range', min: 0, max: 1000, value: 1000, 'aria-label': 'Time of the replay' });
  const clock = make('output'), state = { time: replay.length, playing: false, speed: 8, before: 0 };
  const write = () => {
    clock.textContent = `${duration(state.time)} of ${duration(replay.length)}`;
    slider.value = replay.length > 0 ? Math.round(1000 * state.time / replay.length) : 1000;
    slider.setAttribute('aria-valuetext', clock.textContent);
    show(state.time);
  };
  const tick = (now) => {
    if (!state.playing) return;
    state.time = Math.min(replay.length, state.time + state.speed * Math.min((now - state.before) / 1000, 0.2));
    state.before = now;
    write();
    if (state.time >= replay.length) play(false);
    else requestAnimationFrame(tick);
  };
  const player = button('▶ Play', () => play(!state.playing), { 'aria-pressed': 'false' });
  function play(on) {
    if (on && state.time >= replay.length) state.time = 0;
    Object.assign(state, { playing: on, before: performance.now() });
    player.textContent = on ? '❚❚ Pause' : '▶ Play';
    player.setAttribute('aria-pressed', String(on));
    if (on) requestAnimationFrame(tick);
  }
  slider.addEventListener('input', () => {
    state.time = replay.length * Number(slider.value) / 1000;
    write();
  });
  const speeds = [1, 2, 8, 30, 120], faster = select('Speed', speeds.map((speed) => `${speed} ×`), (index) => { state.speed = speeds[index]; });
  const fitting = speeds.findIndex((speed) => replay.length / speed < 25);
  faster.list.value = fitting < 0 ? speeds.length - 1 : fitting;
  state.speed = speeds[faster.list.value];
  const together = checkbox('all robots from their starts', false, (on) => {
    replay.together = on;
    replay.arrange();
    state.time = replay.length;
    write();
  });
  const step = (direction) => {
    state.time = Math.min(replay.length, Math.max(0, state.time + direction * replay.length / 100));
    write();
  };
  write();
  return { element: make('div', { class: 'bar' }, player, slider, clock, faster.element, replay.spans.length > 1 ? together : null),
    toggle: () => play(!state.playing), step, stop: () => play(false) };
}
