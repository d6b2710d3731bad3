// The view of two meshes: an own rasteriser into typed arrays, so that 10^5 elements are redrawn while one drags.
"use strict";
(() => {
const VIRIDIS = ("440154 471164 482071 472e7c 443b84 3f4889 3a548c 34608d 2f6c8e 2a768e 26818e 228b8d 1f958b 1fa088 " +
  "24aa83 2fb47c 42be71 58c765 70cf57 8bd646 a8db34 c5e021 e2e418 fde725").split(" ").map(hex => parseInt(hex, 16));
// Okabe and Ito's colours, which the colour-blind tell apart, made pale so that lines stand out on them.
const NAMED = [0xa6cee8, 0xf3c887, 0x94d3bd, 0xf5ec9c, 0xe6bfd6, 0x7fb2d3, 0xe9ab84, 0xd9dde2];
const MISSING = 0xb8bec6, PLAIN = 0xeef3f8;
const SHADES = 256, LINES = 20, SHORT = 3, LARGEST_ZOOM = 1e4, IDLE = 150, SLOW = 80;
const TYPES = {f4: Float32Array, u4: Uint32Array, u1: Uint8Array};
const element = id => document.getElementById(id);

// Numbers come as planes of their bytes, deflated, in base64.
async function unpacked({type, data}) {
  const bytes = Uint8Array.from(atob(data), letter => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  const planes = new Uint8Array(await new Response(stream).arrayBuffer());
  const size = TYPES[type].BYTES_PER_ELEMENT, count = planes.length / size;
  const whole = new Uint8Array(planes.length);
  for (let b = 0; b < size; b++) for (let i = 0; i < count; i++) whole[i * size + b] = planes[b * count + i];
  return new TYPES[type](whole.buffer);
}

async function meshOf(packed) {
  const [x, y, nodes, outline] = await Promise.all([packed.x, packed.y, packed.t, packed.outline].map(unpacked));
  const values = await Promise.all(packed.values.map(each => each && unpacked(each)));
  const mesh = {name: packed.name, centre: packed.centre, x, y, nodes, outline, values};
  mesh.count = nodes.length / 3;
  mesh.edges = edgesOf(nodes, x.length);
  return mesh;
}

// Pairs of nodes, each edge once.
function edgesOf(nodes, nnodes) {
  const m = nodes.length / 3, keys = new Float64Array(3 * m);
  for (let side = 0, k = 0; side < 3; side++) for (let e = 0; e < m; e++) {
    const a = nodes[side * m + e], b = nodes[(side + 1) % 3 * m + e];
    keys[k++] = Math.min(a, b) * nnodes + Math.max(a, b);
  }
  keys.sort();
  const edges = [];
  for (let k = 0; k < keys.length; k++) if (k === 0 || keys[k] !== keys[k - 1]) edges.push(keys[k]);
  const pairs = new Uint32Array(2 * edges.length);
  edges.forEach((key, k) => { pairs[2 * k] = Math.floor(key / nnodes); pairs[2 * k + 1] = key % nnodes; });
  return pairs;
}

// Quality and size follow from the mesh itself: 4 sqrt(3) area / sum of squared edges, and sqrt(area).
function shapeOf(mesh, wanted) {
  const {x, y, nodes: t, count: m} = mesh, found = new Float32Array(m);
  for (let e = 0; e < m; e++) {
    const a = t[e], b = t[m + e], c = t[2 * m + e];
    const ux = x[b] - x[a], uy = y[b] - y[a], vx = x[c] - x[a], vy = y[c] - y[a];
    const area = Math.abs(ux * vy - uy * vx) / 2;
    const squares = ux * ux + uy * uy + vx * vx + vy * vy + (ux - vx) ** 2 + (uy - vy) ** 2;
    found[e] = wanted === "quality" ? 4 * Math.sqrt(3) * area / squares : Math.sqrt(area);
  }
  return found;
}

// The plane a + b x + c y of a nodal field over every element.
function planesOf(mesh, values) {
  const {x, y, nodes: t, count: m} = mesh, planes = new Float64Array(3 * m);
  for (let e = 0; e < m; e++) {
    const i = t[e], j = t[m + e], k = t[2 * m + e];
    const ux = x[j] - x[i], uy = y[j] - y[i], vx = x[k] - x[i], vy = y[k] - y[i];
    const du = values[j] - values[i], dv = values[k] - values[i], det = ux * vy - uy * vx;
    const gx = (du * vy - dv * uy) / det, gy = (dv * ux - du * vx) / det;
    planes[3 * e] = values[i] - gx * x[i] - gy * y[i];
    planes[3 * e + 1] = gx;
    planes[3 * e + 2] = gy;
  }
  return planes;
}

const pixelOf = colour => (0xff000000 | (colour & 0xff) << 16 | colour & 0xff00 | colour >> 16) >>> 0;
const RAMP = Uint32Array.from({length: SHADES}, (_, k) => {
  const at = k / (SHADES - 1) * (VIRIDIS.length - 1), low = Math.min(Math.floor(at), VIRIDIS.length - 2);
  const mixed = shift => Math.round((1 - at + low) * (VIRIDIS[low] >> shift & 255) + (at - low) * (VIRIDIS[low + 1] >> shift & 255));
  return pixelOf(mixed(16) << 16 | mixed(8) << 8 | mixed(0));
});

// A function from values to pixels.
function painter(field) {
  if (field.kind === "plain") return () => pixelOf(PLAIN);
  if (field.names) return value => pixelOf(NAMED[value % NAMED.length]);
  const logarithmic = field.scale === "log", change = logarithmic ? Math.log : Number;
  const low = change(field.low), factor = (SHADES - 1) / (change(field.high) - low || 1);
  return value => {
    if (Number.isNaN(value)) return pixelOf(MISSING);
    if (logarithmic && value <= 0) return RAMP[0];
    return RAMP[Math.max(0, Math.min(SHADES - 1, Math.round((change(value) - low) * factor)))];
  };
}

// One mesh as it looks now: which element every pixel shows, and an image of it.
class Layer {
  constructor(mesh) {
    this.mesh = mesh;
    this.canvas = document.createElement("canvas");
    this.context = this.canvas.getContext("2d");
    this.across = new Float64Array(mesh.x.length);
    this.down = new Float64Array(mesh.x.length);
    this.planes = new Map();
  }

  resize(width, height) {
    this.drawn = null;
    this.canvas.width = width;
    this.canvas.height = height;
    this.ids = new Int32Array(width * height);
    this.image = this.context.createImageData(width, height);
    this.pixels = new Uint32Array(this.image.data.buffer);
  }

  valuesOf(k, field) {
    if (!this.mesh.values[k] && (field.kind === "quality" || field.kind === "size")) {
      this.mesh.values[k] = shapeOf(this.mesh, field.kind);
    }
    return this.mesh.values[k];
  }

  coloursOf(k, field) {
    if (this.coloured && this.coloured.k === k) return this.coloured.colours;
    const paint = painter(field), values = this.valuesOf(k, field), colours = new Uint32Array(this.mesh.count);
    for (let e = 0; e < colours.length; e++) colours[e] = paint(values && values[e]);
    this.coloured = {k, colours};
    return colours;
  }

  planesOf(k) {
    if (!this.planes.has(k)) this.planes.set(k, planesOf(this.mesh, this.mesh.values[k]));
    return this.planes.get(k);
  }

  // Draw the columns from `begin` up to `end`; what stands already is kept.
  draw(begin, end, camera, k, field, edges, lines) {
    const look = [camera.x, camera.y, camera.zoom, k, edges, lines && lines.k].join();
    if (this.drawn && this.drawn.look === look && this.drawn.begin <= begin && this.drawn.end >= end) return;
    const place = [camera.x, camera.y, camera.zoom, begin, end].join();
    this.begin = begin;
    this.end = end;
    if (this.placed !== place || !this.drawn) this.place(camera);
    this.placed = place;
    this.paint(k, field, edges, lines);
    this.drawn = {look, begin, end};
  }

  // Where the view stands: pixels = size / 2 + zoom * (point - centre), y upwards; points relative to the mesh's centre.
  place(camera) {
    const {x, y, centre} = this.mesh, {width, height} = this.canvas, {zoom} = camera;
    this.zoom = zoom;
    this.left = width / 2 + zoom * (centre[0] - camera.x);
    this.top = height / 2 - zoom * (centre[1] - camera.y);
    for (let i = 0; i < x.length; i++) {
      this.across[i] = this.left + zoom * x[i];
      this.down[i] = this.top - zoom * y[i];
    }
    this.rasterise();
  }

  rasterise() {
    const {nodes: t, count: m} = this.mesh, {across, down, ids, begin: left, end: right} = this, {width, height} = this.canvas;
    ids.fill(-1);
    for (let e = 0; e < m; e++) {
      let a = t[e], b = t[m + e], c = t[2 * m + e], swap;
      if (down[a] > down[b]) { swap = a; a = b; b = swap; }
      if (down[b] > down[c]) { swap = b; b = c; c = swap; }
      if (down[a] > down[b]) { swap = a; a = b; b = swap; }
      const ya = down[a], yb = down[b], yc = down[c], xa = across[a], xb = across[b], xc = across[c];
      if (yc < 0 || ya > height || Math.max(xa, xb, xc) < left || Math.min(xa, xb, xc) > right) continue;
      const first = Math.max(0, Math.ceil(ya - 0.5)), last = Math.min(height - 1, Math.ceil(yc - 0.5) - 1);
      for (let row = first; row <= last; row++) {
        const y = row + 0.5;
        const long = xa + (y - ya) * (xc - xa) / (yc - ya);
        const short = y < yb ? xa + (y - ya) * (xb - xa) / (yb - ya) : xb + (y - yb) * (xc - xb) / (yc - yb);
        const begin = row * width + Math.max(left, Math.ceil(Math.min(long, short) - 0.5));
        const end = row * width + Math.min(right, Math.ceil(Math.max(long, short) - 0.5));
        for (let p = begin; p < end; p++) ids[p] = e;
      }
    }
  }

  paint(k, field, edges, lines) {
    if (field.at === "node") this.shadeNodes(k, field);
    else this.shadeElements(k, field);
    if (edges) this.drawEdges();
    if (lines) this.drawLines(lines.k, lines.field);
    this.context.putImageData(this.image, 0, 0, this.begin, 0, this.end - this.begin, this.canvas.height);
    this.drawOutline();
  }

  shadeElements(k, field) {
    const {ids, pixels} = this, colours = this.coloursOf(k, field);
    for (let p = 0; p < pixels.length; p++) pixels[p] = ids[p] < 0 ? 0 : colours[ids[p]];
  }

  // For every pixel of the mesh its element and the point under it, relative to the mesh's centre.
  eachPixel(visit) {
    const {ids, left, top, zoom, begin, end} = this, {width, height} = this.canvas;
    for (let row = 0; row < height; row++) {
      const y = (top - row - 0.5) / zoom;
      for (let column = begin, p = row * width + begin; column < end; column++, p++) {
        if (ids[p] >= 0) visit(p, ids[p], (column + 0.5 - left) / zoom, y);
      }
    }
  }

  shadeNodes(k, field) {
    const paint = painter(field), planes = this.planesOf(k), {pixels} = this;
    pixels.fill(0);
    this.eachPixel((p, e, x, y) => {
      pixels[p] = paint(planes[3 * e] + planes[3 * e + 1] * x + planes[3 * e + 2] * y);
    });
  }

  // Contours: where the nearest level is less than a pixel away.
  drawLines(k, field) {
    const planes = this.planesOf(k), step = (field.high - field.low) / (LINES + 1);
    if (!(step > 0)) return;
    this.eachPixel((p, e, x, y) => {
      const gx = planes[3 * e + 1], gy = planes[3 * e + 2];
      const level = (planes[3 * e] + gx * x + gy * y - field.low) / step, nearest = Math.round(level);
      if (nearest < 1 || nearest > LINES) return;
      const pixels = Math.abs(level - nearest) * step * this.zoom / Math.hypot(gx, gy);
      if (pixels < 1.2) this.contrast(p, Math.min(1, 1.4 - pixels) * 0.85);
    });
  }

  darken(p, share) {
    const pixel = this.pixels[p], rest = 1 - share;
    this.pixels[p] = (0xff000000 | (pixel >> 16 & 255) * rest << 16 | (pixel >> 8 & 255) * rest << 8 | (pixel & 255) * rest) >>> 0;
  }

  lighten(p, share) {
    const pixel = this.pixels[p], mixed = shift => (pixel >> shift & 255) * (1 - share) + 255 * share;
    this.pixels[p] = (0xff000000 | mixed(16) << 16 | mixed(8) << 8 | mixed(0)) >>> 0;
  }

  touch(column, row, share) {
    if (column >= this.begin && column < this.end) this.contrast(row * this.canvas.width + column, share);
  }

  // A share of a line on a pixel: dark on light colours, light on dark ones.
  contrast(p, share) {
    const pixel = this.pixels[p];
    if (pixel === 0) return;
    const bright = 3 * (pixel & 255) + 6 * (pixel >> 8 & 255) + (pixel >> 16 & 255);
    if (bright > 1000) this.darken(p, share);
    else this.lighten(p, 0.8 * share);
  }

  // Smooth lines (Wu's); short ones fainter, so that fine parts keep the colour of their field.
  drawEdges() {
    const {edges} = this.mesh, {across, down, begin, end} = this, {height} = this.canvas;
    for (let k = 0; k < edges.length; k += 2) {
      let x = across[edges[k]], y = down[edges[k]], x1 = across[edges[k + 1]], y1 = down[edges[k + 1]];
      if (Math.max(x, x1) < begin || Math.min(x, x1) > end || Math.max(y, y1) < 0 || Math.min(y, y1) > height) continue;
      const share = 0.6 * Math.min(1, (Math.hypot(x1 - x, y1 - y) / density() - SHORT) / 11);
      if (share <= 0) continue;
      if (Math.abs(x1 - x) > Math.abs(y1 - y)) this.flatLine(x, y, x1, y1, share);
      else this.steepLine(x, y, x1, y1, share);
    }
  }

  flatLine(x, y, x1, y1, share) {
    if (x > x1) [x, y, x1, y1] = [x1, y1, x, y];
    const slope = (y1 - y) / (x1 - x || 1), {height} = this.canvas;
    const last = Math.min(this.end - 1, Math.ceil(x1 - 0.5) - 1);
    for (let column = Math.max(this.begin, Math.ceil(x - 0.5)); column <= last; column++) {
      const at = y + (column + 0.5 - x) * slope - 0.5, row = Math.floor(at), part = at - row;
      if (row >= 0 && row < height) this.touch(column, row, share * (1 - part));
      if (row >= -1 && row < height - 1) this.touch(column, row + 1, share * part);
    }
  }

  steepLine(x, y, x1, y1, share) {
    if (y > y1) [x, y, x1, y1] = [x1, y1, x, y];
    const slope = (x1 - x) / (y1 - y || 1), {height} = this.canvas;
    const last = Math.min(height - 1, Math.ceil(y1 - 0.5) - 1);
    for (let row = Math.max(0, Math.ceil(y - 0.5)); row <= last; row++) {
      const at = x + (row + 0.5 - y) * slope - 0.5, column = Math.floor(at), part = at - column;
      this.touch(column, row, share * (1 - part));
      this.touch(column + 1, row, share * part);
    }
  }

  drawOutline() {
    const {outline} = this.mesh, {across, down, context} = this;
    context.beginPath();
    for (let k = 0; k < outline.length; k += 2) {
      context.moveTo(across[outline[k]], down[outline[k]]);
      context.lineTo(across[outline[k + 1]], down[outline[k + 1]]);
    }
    context.lineCap = "round";
    for (const [width, colour] of [[3.2, "rgba(255, 255, 255, 0.6)"], [1.6, "#14181d"]]) {
      context.lineWidth = width * density();
      context.strokeStyle = colour;
      context.stroke();
    }
  }

  valueAt(k, field, column, row) {
    const e = this.ids[row * this.canvas.width + column];
    if (!(e >= 0)) return null;
    const x = (column + 0.5 - this.left) / this.zoom, y = (this.top - row - 0.5) / this.zoom;
    const point = [x + this.mesh.centre[0], y + this.mesh.centre[1]];
    if (field.kind === "plain") return {e, point, value: null};
    if (field.at !== "node") return {e, point, value: this.valuesOf(k, field)[e]};
    const planes = this.planesOf(k);
    return {e, point, value: planes[3 * e] + planes[3 * e + 1] * x + planes[3 * e + 2] * y};
  }
}

const density = () => Math.min(2, window.devicePixelRatio || 1);
const digits = (value, count = 4) => {
  if (value === 0 || !Number.isFinite(value)) return String(value);
  const size = Math.abs(value);
  return size >= 1e5 || size < 1e-3 ? value.toExponential(count - 2) : String(Number(value.toPrecision(count)));
};

class View {
  constructor(data, meshes) {
    this.data = data;
    this.layers = meshes.map(mesh => new Layer(mesh));
    this.canvas = element("canvas");
    this.context = this.canvas.getContext("2d");
    this.fields = [...data.fields, {label: "mesh only", kind: "plain", at: "element"}];
    this.contours = this.fields.findIndex(field => field.at === "node");
    this.divide = 0.5;
    this.detailed = 0;
    this.pointers = new Map();
    this.fill();
    this.listen();
    this.resize();
  }

  fill() {
    this.fields.forEach((field, k) => element("field").add(new Option(field.label, k)));
    if (this.contours >= 0) {
      element("lines-name").textContent = "lines of " + this.fields[this.contours].label.replace(/ \(.*/, "");
      element("lines-label").hidden = false;
    }
  }

  resize() {
    const [low, high] = this.data.bounds, width = this.canvas.clientWidth;
    const shape = (high[1] - low[1]) / (high[0] - low[0]);
    const height = Math.round(Math.max(240, Math.min(width * shape, 0.72 * window.innerHeight)));
    this.canvas.style.height = height + "px";
    this.canvas.width = Math.max(1, Math.round(width * density()));
    this.canvas.height = Math.max(1, Math.round(height * density()));
    this.layers.forEach(layer => layer.resize(this.canvas.width, this.canvas.height));
    this.reset();
  }

  reset() {
    const [low, high] = this.data.bounds, {width, height} = this.canvas;
    const zoom = 0.96 * Math.min(width / (high[0] - low[0]), height / (high[1] - low[1]));
    this.fitted = zoom;
    this.camera = {x: (low[0] + high[0]) / 2, y: (low[1] + high[1]) / 2, zoom};
    this.ask();
  }

  // Redraw before the next frame, once however often it is asked; while things move without edges if those take long.
  // When nothing more comes, all that is left out is drawn, and what the divider hides.
  ask(moving = false) {
    this.moving = moving;
    this.hurry = moving && this.detailed > SLOW;
    clearTimeout(this.later);
    this.later = setTimeout(() => {
      if (this.hurry) this.draw(false);
      this.drawParts([[0, this.canvas.width], [0, this.canvas.width]], false);
    }, IDLE);
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => { this.asked = false; this.draw(this.hurry); });
  }

  drawParts(parts, hurry) {
    const lines = element("lines").checked && this.contours >= 0 && {k: this.contours, field: this.fields[this.contours]};
    const looks = [this.camera, this.chosen(), this.field(), element("edges").checked && !hurry, lines];
    this.layers.forEach((layer, k) => layer.draw(...parts[k], ...looks));
  }

  draw(hurry) {
    const start = performance.now(), {width} = this.canvas, at = Math.round(this.divide * width);
    this.drawParts([[0, at], [at, width]], hurry);
    this.compose();
    this.showScale();
    if (this.moving && !hurry) this.detailed = performance.now() - start;
    // One finger scrolls the page past the whole mesh, and moves within it.
    this.canvas.style.touchAction = this.camera.zoom > 1.01 * this.fitted ? "none" : "pan-y";
    this.canvas.dataset.milliseconds = (performance.now() - start).toFixed(1);
    this.canvas.dataset.draws = Number(this.canvas.dataset.draws || 0) + 1;
  }

  chosen() { return Number(element("field").value); }
  field() { return this.fields[this.chosen()]; }

  compose() {
    const {width, height} = this.canvas, {context} = this, at = Math.round(this.divide * width), scale = density();
    context.clearRect(0, 0, width, height);
    if (at > 0) context.drawImage(this.layers[0].canvas, 0, 0, at, height, 0, 0, at, height);
    if (at < width) context.drawImage(this.layers[1].canvas, at, 0, width - at, height, at, 0, width - at, height);
    context.fillStyle = "#d55e00";
    context.fillRect(at - scale, 0, 2 * scale, height);
    context.beginPath();
    context.arc(at, height / 2, 7 * scale, 0, 2 * Math.PI);
    context.fill();
    context.save();
    context.beginPath();
    context.rect(0, 0, at - scale, height);
    context.clip();
    this.tag(this.layers[0].mesh.name, "left");
    context.restore();
    context.save();
    context.beginPath();
    context.rect(at + scale, 0, width, height);
    context.clip();
    this.tag(this.layers[1].mesh.name, "right");
    context.restore();
  }

  tag(text, side) {
    const {context} = this, scale = density();
    context.font = `600 ${13 * scale}px system-ui, sans-serif`;
    const wide = context.measureText(text).width + 14 * scale;
    const left = side === "left" ? 8 * scale : this.canvas.width - wide - 8 * scale;
    context.fillStyle = "rgba(20, 24, 29, 0.78)";
    context.fillRect(left, 8 * scale, wide, 22 * scale);
    context.fillStyle = "#ffffff";
    context.fillText(text, left + 7 * scale, 23.5 * scale);
  }

  showScale() {
    const field = this.field();
    if (this.scaled === field) return;
    this.scaled = field;
    element("scale").replaceChildren(...(field.kind === "plain" ? [] : field.names ? [namesOf(field)] : barOf(field)));
  }

  zoomBy(factor, column, row) {
    const {camera, canvas, fitted} = this;
    const zoom = Math.max(0.5 * fitted, Math.min(LARGEST_ZOOM * fitted, camera.zoom * factor));
    const right = column - canvas.width / 2, up = canvas.height / 2 - row;
    camera.x += right / camera.zoom - right / zoom;
    camera.y += up / camera.zoom - up / zoom;
    camera.zoom = zoom;
    this.ask(true);
  }

  zoomMiddle(factor) { this.zoomBy(factor, this.canvas.width / 2, this.canvas.height / 2); }

  move(right, down) {
    this.camera.x -= right / this.camera.zoom;
    this.camera.y += down / this.camera.zoom;
    this.ask(true);
  }

  setDivide(share) {
    this.divide = Math.max(0, Math.min(1, share));
    element("divider").value = 100 * this.divide;
    this.ask();
  }

  at(event) {
    const box = this.canvas.getBoundingClientRect(), edge = this.canvas.clientLeft;
    const scale = this.canvas.width / this.canvas.clientWidth;
    return {column: (event.clientX - box.left - edge) * scale, row: (event.clientY - box.top - edge) * scale};
  }

  nearDivider(place) { return Math.abs(place.column - this.divide * this.canvas.width) < 10 * density(); }

  listen() {
    const {canvas} = this;
    canvas.addEventListener("wheel", event => {
      event.preventDefault();
      const {column, row} = this.at(event), lines = event.deltaMode === 1 ? 30 : 1;
      this.zoomBy(Math.exp(-0.0016 * lines * event.deltaY), column, row);
    }, {passive: false});
    canvas.addEventListener("pointerdown", event => this.press(event));
    canvas.addEventListener("pointermove", event => this.drag(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, event => this.release(event));
    canvas.addEventListener("pointerleave", () => this.say(null));
    canvas.addEventListener("keydown", event => this.pressKey(event));
    element("divider").addEventListener("input", event => this.setDivide(event.target.value / 100));
    element("field").addEventListener("change", () => this.ask());
    for (const id of ["edges", "lines"]) element(id).addEventListener("change", () => this.ask());
    element("closer").addEventListener("click", () => this.zoomMiddle(1.5));
    element("farther").addEventListener("click", () => this.zoomMiddle(1 / 1.5));
    element("reset").addEventListener("click", () => this.reset());
    let width = canvas.clientWidth;
    window.addEventListener("resize", () => {
      if (canvas.clientWidth === width) return;
      width = canvas.clientWidth;
      this.resize();
    });
  }

  press(event) {
    const place = this.at(event);
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, place);
    this.dividing = this.pointers.size === 1 && this.nearDivider(place);
    this.hover(place);
  }

  drag(event) {
    const place = this.at(event), before = this.pointers.get(event.pointerId);
    this.canvas.style.cursor = this.nearDivider(place) ? "ew-resize" : before ? "grabbing" : "grab";
    if (!before) { this.hover(place); return; }
    if (this.dividing) { this.setDivide(place.column / this.canvas.width); return; }
    if (this.pointers.size === 2) this.pinch(event.pointerId, before, place);
    else this.move(place.column - before.column, place.row - before.row);
    this.pointers.set(event.pointerId, place);
  }

  pinch(moving, before, place) {
    const [, other] = [...this.pointers].find(([id]) => id !== moving);
    const far = from => Math.max(1, Math.hypot(from.column - other.column, from.row - other.row));
    this.move((place.column - before.column) / 2, (place.row - before.row) / 2);
    this.zoomBy(far(place) / far(before), (place.column + other.column) / 2, (place.row + other.row) / 2);
  }

  release(event) {
    this.pointers.delete(event.pointerId);
    this.dividing = false;
  }

  pressKey(event) {
    const step = 40 * density();
    const deeds = {
      "+": () => this.zoomMiddle(1.25), "=": () => this.zoomMiddle(1.25), "-": () => this.zoomMiddle(0.8),
      "0": () => this.reset(), ArrowLeft: () => this.move(step, 0), ArrowRight: () => this.move(-step, 0),
      ArrowUp: () => this.move(0, step), ArrowDown: () => this.move(0, -step),
    };
    if (event.ctrlKey || event.metaKey || event.altKey || !(event.key in deeds)) return;
    event.preventDefault();
    deeds[event.key]();
  }

  hover(place) {
    const layer = this.layers[place.column < this.divide * this.canvas.width ? 0 : 1];
    const column = Math.floor(place.column), row = Math.floor(place.row), {width, height} = this.canvas;
    const inside = column >= 0 && row >= 0 && column < width && row < height;
    this.say(layer.mesh.name, inside ? layer.valueAt(this.chosen(), this.field(), column, row) : null);
  }

  say(name, found = null) {
    const field = this.field(), unit = this.data.unit && " " + this.data.unit;
    if (!found) { element("value").textContent = "Point at the mesh to read values."; return; }
    const value = found.value === null ? "" : `${field.label}: ${field.names ? field.names[found.value] : digits(found.value)}; `;
    const [x, y] = found.point.map(each => digits(each, 5));
    element("value").textContent = `${name}: ${value}element ${found.e}, x = ${x}${unit}, y = ${y}${unit}`;
  }
}

function made(tag, name, text = "") {
  const node = document.createElement(tag);
  node.className = name;
  node.textContent = text;
  return node;
}

const css = colour => "#" + colour.toString(16).padStart(6, "0");

function namesOf(field) {
  const list = made("ul", "names");
  field.names.forEach((name, k) => {
    const item = document.createElement("li"), swatch = made("span", "swatch");
    swatch.style.background = css(NAMED[k % NAMED.length]);
    item.append(swatch, made("span", "", name));
    list.append(item);
  });
  return list;
}

function barOf(field) {
  const bar = made("div", "bar"), ends = made("div", "ends");
  bar.style.background = `linear-gradient(to right, ${VIRIDIS.map(css).join(", ")})`;
  const {low, high} = field, parts = [0, 0.25, 0.5, 0.75, 1];
  const level = part => field.scale === "log" ? low * (high / low) ** part : low + part * (high - low);
  parts.forEach((part, k) => {
    const mark = k === 0 && field.below ? "≤ " : k === parts.length - 1 && field.above ? "≥ " : "";
    ends.append(made("span", "", mark + digits(level(part), 3)));
  });
  return [bar, ends, made("div", "quantity", field.label + (field.scale === "log" ? ", logarithmic" : ""))];
}

async function show() {
  const data = JSON.parse(element("view-data").textContent);
  const meshes = await Promise.all(data.meshes.map(meshOf));
  element("view").hidden = false;
  new View(data, meshes);
}

show().catch(error => {
  element("trouble").textContent = `The view cannot be shown here (${error}); the pictures below do not need it.`;
  element("trouble").hidden = false;
});
})();
