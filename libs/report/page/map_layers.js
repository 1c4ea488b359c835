// What a map consists of, drawn layer by layer onto a viewport.

const unknownShade = '#e4e4e4';

// The poses of a trajectory, from their differences: seconds, metres, radians.
function poses(trajectory) {
  if (trajectory.poses) return trajectory.poses;
  const sums = (differences, unit, first = 0) => {
    const values = new Float64Array(differences.length);
    for (let i = 0, sum = 0; i < values.length; ++i) values[i] = first + (sum += differences[i]) * unit;
    return values;
  };
  trajectory.poses = { t: sums(trajectory.t_ms, 1e-3, trajectory.first_s), x: sums(trajectory.x_mm, 1e-3), y: sums(trajectory.y_mm, 1e-3),
    yaw: sums(trajectory.yaw_mrad, 1e-3) };
  return trajectory.poses;
}

// Points of cameras: metres, and colours as of a canvas.
function pointsOf(map) {
  const stored = map.points;
  if (!stored || stored.decoded) return stored && stored.decoded;
  const bytes = bytesOf(stored.data), view = new DataView(bytes.buffer), count = stored.count;
  const xyz = new Float32Array(3 * count), rgb = new Uint8Array(3 * count);
  for (let i = 0; i < count; ++i) {
    for (let axis = 0; axis < 3; ++axis) xyz[3 * i + axis] = stored.low[axis] + view.getUint16(8 * i + 2 * axis, true) * stored.step[axis];
    const colour = view.getUint16(8 * i + 6, true);
    rgb.set([(colour >> 11) << 3, ((colour >> 5) & 63) << 2, (colour & 31) << 3], 3 * i);
  }
  stored.decoded = { xyz, rgb, count };
  stored.data = null;
  return stored.decoded;
}

// The picture of a grid whose pixels are not much finer or coarser than the screen's; null until it is decoded.
function levelFor(grid, scale, redraw) {
  const levels = grid.levels;
  const wanted = levels.find((level) => level.metres_per_pixel * scale <= 1.5) ? levels.findLastIndex((level) => level.metres_per_pixel * scale <= 1.5) : 0;
  const order = [...levels.keys()].reverse().sort((a, b) => Math.abs(a - wanted) - Math.abs(b - wanted));
  const load = (level) => {
    if (level.image) return;
    level.image = new Image();
    level.image.decoding = 'async';
    level.image.addEventListener('load', () => {
      level.ready = true;
      for (const again of level.waiting) again();
    });
    level.waiting = new Set();
    level.image.src = level.png;
  };
  load(levels[wanted]);
  if (!levels[wanted].ready) levels[wanted].waiting.add(redraw);
  const best = order.find((index) => levels[index].ready);
  return best === undefined ? null : levels[best];
}

function drawGrid(context, viewport, map, redraw) {
  context.fillStyle = map.grid ? unknownShade : '#fff';
  context.fillRect(0, 0, viewport.width, viewport.height);
  if (!map.grid) return;
  const level = levelFor(map.grid, viewport.scale, redraw);
  if (!level) return;
  context.imageSmoothingEnabled = level.metres_per_pixel * viewport.scale < 1.5;
  const width = level.columns * level.metres_per_pixel * viewport.scale, height = level.rows * level.metres_per_pixel * viewport.scale;
  context.drawImage(level.image, viewport.column(level.x), viewport.row(level.y) - height, width, height);
}

function drawPointsFromAbove(context, viewport, map, colour, place = (x, y) => [x, y]) {
  const points = pointsOf(map);
  if (!points) return;
  const size = viewport.scale > 60 ? 2 : 1.3;
  for (let i = 0; i < points.count; ++i) {
    if (map.grid && points.xyz[3 * i + 2] === 0) continue;  // a wall, which the grid has
    const [x, y] = place(points.xyz[3 * i], points.xyz[3 * i + 1], points.xyz[3 * i + 2]);
    const column = viewport.column(x), row = viewport.row(y);
    if (column < 0 || row < 0 || column > viewport.width || row > viewport.height) continue;
    context.fillStyle = colour || `rgb(${points.rgb[3 * i]},${points.rgb[3 * i + 1]},${points.rgb[3 * i + 2]})`;
    context.fillRect(column, row, size, size);
  }
}

// The piece of a trajectory until `until` (seconds of its own stamps).
function traceTrajectory(context, viewport, trajectory, until) {
  const { t, x, y } = poses(trajectory);
  context.beginPath();
  for (let i = 0; i < t.length && t[i] <= until; ++i) context.lineTo(viewport.column(x[i]), viewport.row(y[i]));
}

function drawTrajectory(context, viewport, trajectory, look, until) {
  context.lineJoin = context.lineCap = 'round';
  context.setLineDash([]);
  context.strokeStyle = 'rgba(255,255,255,.8)';
  context.lineWidth = 4.5;
  traceTrajectory(context, viewport, trajectory, Infinity);
  context.stroke();
  context.strokeStyle = look.colour;
  if (until < Infinity) {
    context.globalAlpha = 0.3;
    context.lineWidth = 1;
    context.stroke();
    context.globalAlpha = 1;
    traceTrajectory(context, viewport, trajectory, until);
  }
  context.lineCap = 'butt';
  context.setLineDash(look.dash);
  context.lineWidth = 2.2;
  context.stroke();
  context.setLineDash([]);
}

function drawEnds(context, viewport, trajectory, look) {
  const { x, y } = poses(trajectory), last = x.length - 1;
  if (last < 0) return;
  context.lineWidth = 2.5;
  context.fillStyle = '#fff';
  context.strokeStyle = look.colour;
  context.beginPath();
  context.arc(viewport.column(x[0]), viewport.row(y[0]), 6, 0, 2 * Math.PI);
  context.fill();
  context.stroke();
  context.fillStyle = look.colour;
  context.strokeStyle = '#fff';
  context.lineWidth = 1.5;
  context.beginPath();
  context.rect(viewport.column(x[last]) - 5, viewport.row(y[last]) - 5, 10, 10);
  context.fill();
  context.stroke();
}

// Labels give way: one that would lie on another is left out until there is room.
class Labels {
  constructor(context) {
    this.context = context;
    this.taken = [];
  }
  put(text, column, row, colour) {
    const context = this.context;
    context.font = '600 13px system-ui, "DejaVu Sans", sans-serif';
    const width = context.measureText(text).width + 6, box = [column, row - 15, column + width, row + 4];
    if (this.taken.some((other) => box[0] < other[2] && other[0] < box[2] && box[1] < other[3] && other[1] < box[3])) return;
    this.taken.push(box);
    context.textAlign = 'left';
    context.textBaseline = 'alphabetic';
    context.lineWidth = 4;
    context.strokeStyle = '#fff';
    context.strokeText(text, column + 3, row);
    context.fillStyle = colour;
    context.fillText(text, column + 3, row);
  }
}

// Pairs of places of one list: [x, y, x, y] in centimetres.
function drawLinks(context, viewport, links, look) {
  context.strokeStyle = context.fillStyle = look.colour;
  context.lineWidth = look.width;
  context.setLineDash(look.dash);
  context.beginPath();
  for (const [x0, y0, x1, y1] of links) {
    context.moveTo(viewport.column(x0 / 100), viewport.row(y0 / 100));
    context.lineTo(viewport.column(x1 / 100), viewport.row(y1 / 100));
  }
  context.stroke();
  context.setLineDash([]);
  if (links.length > 400) return;
  for (const link of links)
    for (const [x, y] of [link.slice(0, 2), link.slice(2, 4)]) look.mark(context, viewport.column(x / 100), viewport.row(y / 100));
}

const loopLook = { colour: '#333', width: 1, dash: [2, 3], mark: (context, x, y) => {
  context.beginPath();
  context.arc(x, y, 2, 0, 2 * Math.PI);
  context.fill();
} };
const joinLook = { colour: '#a0005a', width: 1.4, dash: [], mark: (context, x, y) => {
  context.beginPath();
  context.moveTo(x, y - 4);
  context.lineTo(x + 4, y + 3);
  context.lineTo(x - 4, y + 3);
  context.fill();
} };

// Walls of one map that another one saw through: a ring with a cross, white below so that it stands out on walls.
function drawConflicts(context, viewport, conflicts) {
  for (const { x_m: x, y_m: y, length_m: length } of conflicts) {
    const column = viewport.column(x), row = viewport.row(y), radius = Math.max(9, 0.5 * length * viewport.scale);
    for (const [colour, width] of [['#fff', 5], ['#c00000', 2.2]]) {
      context.strokeStyle = colour;
      context.lineWidth = width;
      context.beginPath();
      context.arc(column, row, radius, 0, 2 * Math.PI);
      context.moveTo(column - 5, row - 5);
      context.lineTo(column + 5, row + 5);
      context.moveTo(column - 5, row + 5);
      context.lineTo(column + 5, row - 5);
      context.stroke();
    }
  }
}

// Where the robot is at `t`, between its poses; null outside of its trajectory.
function poseAt(trajectory, t) {
  const { t: stamps, x, y, yaw } = poses(trajectory), last = stamps.length - 1;
  if (last < 0 || t < stamps[0] - 1e-6 || t > stamps[last] + 1e-6) return null;
  let low = 0, high = last;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (stamps[middle] <= t) low = middle;
    else high = middle;
  }
  const share = high === low ? 0 : Math.min(1, Math.max(0, (t - stamps[low]) / Math.max(stamps[high] - stamps[low], 1e-9)));
  const turn = Math.atan2(Math.sin(yaw[high] - yaw[low]), Math.cos(yaw[high] - yaw[low]));
  return { x: x[low] + share * (x[high] - x[low]), y: y[low] + share * (y[high] - y[low]), yaw: yaw[low] + share * turn };
}

function drawRobot(context, viewport, pose, look) {
  context.save();
  context.translate(viewport.column(pose.x), viewport.row(pose.y));
  context.rotate(-pose.yaw);
  context.beginPath();
  context.moveTo(12, 0);
  context.lineTo(-8, 8);
  context.lineTo(-4, 0);
  context.lineTo(-8, -8);
  context.closePath();
  context.fillStyle = look.colour;
  context.strokeStyle = '#fff';
  context.lineWidth = 2;
  context.fill();
  context.stroke();
  context.restore();
}
