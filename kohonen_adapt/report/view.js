// The view: two layers, a divider between them, and what wheel, fingers, keys and controls do.
"use strict";

const LARGEST_ZOOM = 1e4;
const IDLE = 150;  // ms without a wish until what was left out is drawn
const SLOW = 80;  // ms from which on a moving picture goes without edges
const element = id => document.getElementById(id);

class View {
  constructor(data, meshes) {
    this.data = data;
    this.layers = meshes.map(mesh => new Layer(mesh));
    this.canvas = element("canvas");
    this.context = this.canvas.getContext("2d");
    this.fields = [...data.fields, {label: "mesh only", kind: "plain", at: "element"}];
    this.contours = this.fields.findIndex(field => field.lines);
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
    element("held-label").hidden = !this.data.reasons.length;
    element("reasons").append(namesOf(this.data.reasons, MARKS));
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
    const k = this.contours, lines = k >= 0 && element("lines").checked && {k, field: this.fields[k]};
    const edges = element("edges").checked && !hurry, held = element("held-nodes").checked;
    const looks = [this.camera, this.chosen(), this.field(), edges, lines, held];
    this.layers.forEach((layer, side) => layer.draw(...parts[side], ...looks));
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
    element("scale").replaceChildren(...(field.kind === "plain" ? [] : field.names ? [namesOf(field.names)] : barOf(field)));
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
    element("held-nodes").addEventListener("change", event => { element("reasons").hidden = !event.target.checked; });
    for (const id of ["edges", "lines", "held-nodes"]) element(id).addEventListener("change", () => this.ask());
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
    const reason = inside && element("held-nodes").checked ? layer.heldAt(column, row) : null;
    this.say(layer.mesh.name, inside ? layer.valueAt(this.chosen(), this.field(), column, row) : null, reason);
  }

  say(name, found = null, reason = null) {
    const field = this.field(), unit = this.data.unit && " " + this.data.unit;
    const held = reason === null ? "" : `held node: ${this.data.reasons[reason]}`;
    if (!found) { element("value").textContent = held || "Point at the mesh to read values."; return; }
    const shown = field.names ? field.names[found.value] : digits(found.value);
    const value = found.value === null ? "" : `${field.label}: ${shown}; `;
    const [x, y] = found.point.map(each => digits(each, 5));
    const [across, up] = this.data.axes;
    element("value").textContent = `${name}: ${value}element ${found.e}, ${across} = ${x}${unit}, ${up} = ${y}${unit}` +
      (held && "; " + held);
  }
}

async function show() {
  const data = JSON.parse(element("view-data").textContent);
  const meshes = await Promise.all(data.meshes.map(meshOf));
  element("view").hidden = false;
  new View(data, meshes);
}

show().catch(error => {
  element("trouble").textContent = `The view cannot be shown here (${error}); all else on this page does without.`;
  element("trouble").hidden = false;
});
