// A canvas that shows a piece of a plane in metres: pan and zoom by mouse, touch and keys.

class Viewport {
  // draw(context, viewport) is called with pixels of the page; bounds: [x0, y0, x1, y1] in metres.
  constructor(canvas, bounds, draw) {
    Object.assign(this, { canvas, bounds, draw, x: 0, y: 0, scale: 1, width: 0, height: 0, fitted: true, asked: false });
    this.onmove = null;
    this.pointers = new Map();
    canvas.addEventListener('pointerdown', (event) => this.press(event));
    canvas.addEventListener('pointermove', (event) => this.move(event));
    for (const name of ['pointerup', 'pointercancel', 'pointerleave'])
      canvas.addEventListener(name, (event) => this.pointers.delete(event.pointerId));
    canvas.addEventListener('wheel', (event) => this.wheel(event), { passive: false });
    canvas.addEventListener('dblclick', (event) => this.zoom(2, event.offsetX, event.offsetY));
    canvas.addEventListener('keydown', (event) => this.key(event));
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  resize() {
    const width = this.canvas.clientWidth, height = this.canvas.clientHeight;
    if (width === 0 || height === 0) return;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    Object.assign(this, { width, height, ratio });
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    if (this.fitted) this.fit();
    this.drawNow();
  }

  show(bounds) {
    this.bounds = bounds;
    this.fit();
  }

  fit() {
    const [x0, y0, x1, y1] = this.bounds;
    this.x = (x0 + x1) / 2;
    this.y = (y0 + y1) / 2;
    this.scale = 0.92 * Math.min(this.width / Math.max(x1 - x0, 0.5), this.height / Math.max(y1 - y0, 0.5));
    this.fitted = true;
    this.redraw();
  }

  // Metres to pixels of the page, and back.
  column(x) { return this.width / 2 + (x - this.x) * this.scale; }
  row(y) { return this.height / 2 - (y - this.y) * this.scale; }
  place(column, row) {
    return [this.x + (column - this.width / 2) / this.scale, this.y - (row - this.height / 2) / this.scale];
  }

  pan(columns, rows) {
    this.x -= columns / this.scale;
    this.y += rows / this.scale;
    this.fitted = false;
    this.redraw();
  }

  zoom(factor, column = this.width / 2, row = this.height / 2) {
    const [x, y] = this.place(column, row);
    this.scale = Math.min(Math.max(this.scale * factor, 1e-3), 2000);
    this.x = x - (column - this.width / 2) / this.scale;
    this.y = y + (row - this.height / 2) / this.scale;
    this.fitted = false;
    this.redraw();
  }

  redraw() {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => this.drawNow());
  }

  drawNow() {
    this.asked = false;
    if (this.width === 0) return;
    const context = this.canvas.getContext('2d');
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    context.clearRect(0, 0, this.width, this.height);
    this.draw(context, this);
  }

  press(event) {
    this.pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
    if (event.pointerType === 'mouse') this.canvas.setPointerCapture(event.pointerId);
  }

  move(event) {
    const before = this.pointers.get(event.pointerId), now = [event.offsetX, event.offsetY];
    if (this.onmove) this.onmove(this.place(...now));
    if (!before) return;
    const others = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
    if (others.length > 0) {
      const apart = (place) => Math.hypot(place[0] - others[0][0], place[1] - others[0][1]);
      const factor = apart(now) / Math.max(apart(before), 1);
      if (factor > 0) this.zoom(factor, (now[0] + others[0][0]) / 2, (now[1] + others[0][1]) / 2);
    }
    const share = others.length > 0 ? 0.5 : 1;
    this.pan(share * (now[0] - before[0]), share * (now[1] - before[1]));
    this.pointers.set(event.pointerId, now);
  }

  // The wheel scrolls the page until the picture was clicked: nobody is caught by it.
  wheel(event) {
    if (document.activeElement !== this.canvas && !event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    this.zoom(Math.exp(-Math.sign(event.deltaY) * Math.min(Math.abs(event.deltaY), 100) * 0.002), event.offsetX, event.offsetY);
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const step = 60;
    const actions = {
      ArrowLeft: () => this.pan(step, 0), ArrowRight: () => this.pan(-step, 0), ArrowUp: () => this.pan(0, step),
      ArrowDown: () => this.pan(0, -step), '+': () => this.zoom(1.4), '=': () => this.zoom(1.4), '-': () => this.zoom(1 / 1.4),
      0: () => this.fit(), Escape: () => this.canvas.blur(),
    };
    if (!actions[event.key]) return;
    event.preventDefault();
    actions[event.key]();
  }
}

function zoomButtons(viewport) {
  return [button('+', () => viewport.zoom(1.4), { 'aria-label': 'Zoom in' }), button('−', () => viewport.zoom(1 / 1.4), { 'aria-label': 'Zoom out' }),
    button('Whole map', () => viewport.fit())];
}

// A bar of a round length with its label, at the lower left.
function drawScaleBar(context, viewport) {
  const most = 150 / viewport.scale, power = 10 ** Math.floor(Math.log10(most));
  const length = [5, 2, 1].find((step) => step * power <= most) * power, pixels = length * viewport.scale;
  const x = 14, y = viewport.height - 14, text = length < 1 ? `${significant(length * 100, 2)} cm` : `${significant(length, 1)} m`;
  context.fillStyle = 'rgba(255,255,255,.85)';
  context.fillRect(x - 6, y - 24, Math.max(pixels, context.measureText(text).width) + 12, 32);
  context.fillStyle = context.strokeStyle = '#111';
  context.lineWidth = 2;
  context.setLineDash([]);
  context.beginPath();
  context.moveTo(x, y - 6);
  context.lineTo(x, y);
  context.lineTo(x + pixels, y);
  context.lineTo(x + pixels, y - 6);
  context.stroke();
  context.font = '12px system-ui, "DejaVu Sans", sans-serif';
  context.textAlign = 'left';
  context.textBaseline = 'alphabetic';
  context.fillText(text, x, y - 10);
}
