// Points of cameras in space, drawn by WebGL: turn by dragging, move with shift, zoom by wheel; all by keys as well.

const pointShaders = [`
  attribute vec3 place;
  attribute vec3 colour;
  uniform mat4 view;
  uniform float size;
  varying vec3 shade;
  void main() {
    gl_Position = view * vec4(place, 1.0);
    gl_PointSize = clamp(size / gl_Position.w, 1.5, 9.0);
    shade = colour;
  }`, `
  precision mediump float;
  varying vec3 shade;
  void main() { gl_FragColor = vec4(shade, 1.0); }`];

function programOf(gl) {
  const program = gl.createProgram();
  [gl.VERTEX_SHADER, gl.FRAGMENT_SHADER].forEach((kind, index) => {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, pointShaders[index]);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  });
  gl.linkProgram(program);
  return gl.getProgramParameter(program, gl.LINK_STATUS) ? program : null;
}

// Column-major, as WebGL takes it: perspective of a camera that looks at `centre` from `distance`, z up.
function viewMatrix({ yaw, pitch, distance, centre }, aspect) {
  const cy = Math.cos(yaw), sy = Math.sin(yaw), cp = Math.cos(pitch), sp = Math.sin(pitch);
  const right = [cy, sy, 0], up = [-sy * sp, cy * sp, cp], back = [sy * cp, -cy * cp, sp];
  const eye = [0, 1, 2].map((axis) => centre[axis] + distance * back[axis]);
  const along = (axis) => -(axis[0] * eye[0] + axis[1] * eye[1] + axis[2] * eye[2]);
  const near = distance / 100, far = distance * 20, focus = 1.6, depth = (far + near) / (near - far), offset = 2 * far * near / (near - far);
  const sx = focus / Math.max(aspect, 1), sz = focus * Math.min(aspect, 1);
  const columns = [0, 1, 2].map((axis) => [sx * right[axis], sz * up[axis], depth * back[axis], -back[axis]]);
  columns.push([sx * along(right), sz * along(up), depth * along(back) + offset, -along(back)]);
  return new Float32Array(columns.flat());
}

class PointsView {
  constructor(canvas, map) {
    this.canvas = canvas;
    this.gl = canvas.getContext('webgl', { antialias: true });
    this.program = this.gl && programOf(this.gl);
    if (!this.program) return;
    this.buffers = [this.gl.createBuffer(), this.gl.createBuffer()];
    this.show(map);
    canvas.addEventListener('pointerdown', (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener('pointermove', (event) => {
      if (event.buttons === 0) return;
      if (event.shiftKey || event.buttons === 2) this.slide(event.movementX, event.movementY);
      else this.turn(-event.movementX * 0.008, event.movementY * 0.008);
    });
    canvas.addEventListener('wheel', (event) => {
      if (document.activeElement !== canvas && !event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      this.zoom(Math.exp(Math.sign(event.deltaY) * 0.15));
    }, { passive: false });
    canvas.addEventListener('contextmenu', (event) => event.preventDefault());
    canvas.addEventListener('keydown', (event) => this.key(event));
    new ResizeObserver(() => this.redraw()).observe(canvas);
    window.addEventListener('beforeprint', () => this.drawNow());
  }

  show(map) {
    const gl = this.gl, points = pointsOf(map);
    this.count = points.count;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[0]);
    gl.bufferData(gl.ARRAY_BUFFER, points.xyz, gl.STATIC_DRAW);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[1]);
    gl.bufferData(gl.ARRAY_BUFFER, points.rgb, gl.STATIC_DRAW);
    const heights = [...points.xyz.filter((_, i) => i % 3 === 2)].sort((a, b) => a - b), [x0, y0, x1, y1] = map.view;
    this.home = { yaw: 0.5, pitch: 0.9, distance: 1.1 * Math.max(x1 - x0, y1 - y0, 1), centre: [(x0 + x1) / 2, (y0 + y1) / 2, heights[heights.length >> 1] || 0] };
    this.reset();
  }
  reset(change) {
    Object.assign(this, structuredClone(this.home), change);
    this.redraw();
  }
  turn(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, this.pitch + pitch));
    this.redraw();
  }
  slide(columns, rows) {
    const step = this.distance / this.canvas.clientHeight, cosine = Math.cos(this.yaw), sine = Math.sin(this.yaw), sp = Math.sin(this.pitch);
    this.centre[0] += step * (-columns * cosine - rows * sine * sp);
    this.centre[1] += step * (-columns * sine + rows * cosine * sp);
    this.centre[2] += step * rows * Math.cos(this.pitch);
    this.redraw();
  }
  zoom(factor) {
    this.distance *= factor;
    this.redraw();
  }
  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const move = event.shiftKey ? (x, y) => this.slide(-40 * x, -40 * y) : (x, y) => this.turn(0.1 * x, 0.1 * y);
    const actions = { ArrowLeft: () => move(-1, 0), ArrowRight: () => move(1, 0), ArrowUp: () => move(0, -1), ArrowDown: () => move(0, 1),
      '+': () => this.zoom(0.8), '=': () => this.zoom(0.8), '-': () => this.zoom(1.25), 0: () => this.reset(), Escape: () => this.canvas.blur() };
    if (!actions[event.key]) return;
    event.preventDefault();
    actions[event.key]();
  }
  redraw() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => this.drawNow());
  }
  drawNow() {
    this.asked = false;
    const { gl, canvas, program } = this, ratio = Math.min(window.devicePixelRatio || 1, 2);
    if (canvas.clientWidth === 0) return;
    canvas.width = Math.round(canvas.clientWidth * ratio);
    canvas.height = Math.round(canvas.clientHeight * ratio);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(1, 1, 1, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(program);
    gl.uniformMatrix4fv(gl.getUniformLocation(program, 'view'), false, viewMatrix(this, canvas.width / canvas.height));
    gl.uniform1f(gl.getUniformLocation(program, 'size'), 0.025 * canvas.height);
    const attribute = (name, buffer, kind, normalized) => {
      const place = gl.getAttribLocation(program, name);
      gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, kind, normalized, 0, 0);
    };
    attribute('place', this.buffers[0], gl.FLOAT, false);
    attribute('colour', this.buffers[1], gl.UNSIGNED_BYTE, true);
    gl.drawArrays(gl.POINTS, 0, this.count);
  }
}

function pointsSection() {
  const maps = run.maps.filter((map) => map.points && map.points.is_in_space);
  if (maps.length === 0) return null;
  const canvas = make('canvas', { class: 'points-canvas points', tabindex: 0, role: 'img', 'aria-label': 'Points in space. Arrow keys turn, with shift they move; plus and minus zoom; 0 shows all.' });
  const status = make('p', { class: 'small soft' }), describe = (map) => {
    const { count, total } = map.points;
    status.textContent = total > count ? `${count} of ${total} points are in this page; all are in ${map.points.file}.` : `${counted(count, 'point')} of ${map.points.file}.`;
  };
  let view = null;
  const chooser = select('Map', maps.map((map) => map.title), (index) => {
    if (view && view.program) view.show(maps[index]);
    describe(maps[index]);
  });
  describe(maps[0]);
  whenSeen(canvas, () => {
    view = new PointsView(canvas, maps[0]);
    if (!view.program) canvas.replaceWith(make('p', { class: 'warning' }, 'This browser has no WebGL: the points cannot be shown. The map above has them from above.'));
  });
  const reset = (text, change) => button(text, () => view && view.program && view.reset(change));
  const controls = make('div', { class: 'bar' }, maps.length > 1 ? chooser.element : null, reset('Aslant', {}), reset('From above', { pitch: Math.PI / 2, yaw: 0 }),
    reset('From the side', { pitch: 0, yaw: 0 }), button('+', () => view && view.zoom(0.8), { 'aria-label': 'Nearer' }), button('−', () => view && view.zoom(1.25), { 'aria-label': 'Farther' }));
  return [controls, canvas, make('p', { class: 'small soft hint' }, 'Drag to turn, with shift to move; click first, then the wheel zooms.'), status];
}
