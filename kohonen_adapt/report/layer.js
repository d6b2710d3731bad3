// The picture of one mesh: a rasteriser of its own into typed arrays, so that 10^5 elements follow a drag.
"use strict";

const LINES = 20;  // contours
const SHORT = 3;  // pixels: shorter edges are not drawn
const density = () => Math.min(2, window.devicePixelRatio || 1);

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

  coloursOf(k, field) {
    if (this.coloured && this.coloured.k === k) return this.coloured.colours;
    const paint = painter(field), values = this.mesh.values[k], colours = new Uint32Array(this.mesh.count);
    for (let e = 0; e < colours.length; e++) colours[e] = paint(values && values[e]);
    this.coloured = {k, colours};
    return colours;
  }

  planesOf(k, field) {
    if (!this.planes.has(k)) this.planes.set(k, planesOf(this.mesh, this.mesh.values[k], field.at));
    return this.planes.get(k);
  }

  // Draw the columns from `begin` up to `end`; what stands already is kept.
  draw(begin, end, camera, k, field, edges, lines, held) {
    const look = [camera.x, camera.y, camera.zoom, k, edges, lines && lines.k, held].join();
    if (this.drawn && this.drawn.look === look && this.drawn.begin <= begin && this.drawn.end >= end) return;
    const place = [camera.x, camera.y, camera.zoom, begin, end].join();
    this.begin = begin;
    this.end = end;
    if (this.placed !== place || !this.drawn) this.place(camera);
    this.placed = place;
    this.paint(k, field, edges, lines);
    if (held) this.drawHeld();
    this.drawn = {look, begin, end};
  }

  // Where the view stands: pixels = size / 2 + zoom * (point - centre), y upwards; points from the mesh's centre.
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
    const {nodes: t, count: m} = this.mesh, {width, height} = this.canvas;
    const {across, down, ids, begin: left, end: right} = this;
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
    if (field.at === "element") this.shadeElements(k, field);
    else this.shadePlanes(k, field);
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

  shadePlanes(k, field) {
    const paint = painter(field), {planes, planeAt} = this.planesOf(k, field), {pixels} = this;
    pixels.fill(0);
    this.eachPixel((p, e, x, y) => {
      const q = planeAt(e, x, y);
      pixels[p] = paint(planes[q] + planes[q + 1] * x + planes[q + 2] * y);
    });
  }

  // Contours: where the nearest level is less than a pixel away.
  drawLines(k, field) {
    const {planes, planeAt} = this.planesOf(k, field), step = (field.high - field.low) / (LINES + 1);
    if (!(step > 0)) return;
    this.eachPixel((p, e, x, y) => {
      const q = planeAt(e, x, y), gx = planes[q + 1], gy = planes[q + 2];
      const level = (planes[q] + gx * x + gy * y - field.low) / step, nearest = Math.round(level);
      if (nearest < 1 || nearest > LINES) return;
      const pixels = Math.abs(level - nearest) * step * this.zoom / Math.hypot(gx, gy);
      if (pixels < 1.2) this.contrast(p, Math.min(1, 1.4 - pixels) * 0.85);
    });
  }

  darken(p, share) {
    const pixel = this.pixels[p], rest = 1 - share;
    const part = shift => (pixel >> shift & 255) * rest << shift;
    this.pixels[p] = (0xff000000 | part(16) | part(8) | part(0)) >>> 0;
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

  drawHeld() {
    const {node, reason} = this.mesh.held, {across, down, context} = this, size = 7 * density();
    context.lineWidth = density();
    context.strokeStyle = "#ffffff";
    node.forEach((v, k) => {
      context.fillStyle = css(MARKS[reason[k] % MARKS.length]);
      context.fillRect(across[v] - size / 2, down[v] - size / 2, size, size);
      context.strokeRect(across[v] - size / 2, down[v] - size / 2, size, size);
    });
  }

  // The reason of the nearest held node under a mark, or null.
  heldAt(column, row) {
    const {node, reason} = this.mesh.held, {across, down} = this;
    let nearest = 7 * density(), found = null;
    node.forEach((v, k) => {
      const far = Math.hypot(across[v] - column, down[v] - row);
      if (far < nearest) [nearest, found] = [far, reason[k]];
    });
    return found;
  }

  valueAt(k, field, column, row) {
    const e = this.ids[row * this.canvas.width + column];
    if (!(e >= 0)) return null;
    const x = (column + 0.5 - this.left) / this.zoom, y = (this.top - row - 0.5) / this.zoom;
    const point = [x + this.mesh.centre[0], y + this.mesh.centre[1]];
    const said = {e: this.mesh.elements ? this.mesh.elements[e] : e, point};  // of a cut, what it is a piece of
    if (field.kind === "plain") return {...said, value: null};
    if (field.at === "element") return {...said, value: this.mesh.values[k][e]};
    const {planes, planeAt} = this.planesOf(k, field), q = planeAt(e, x, y);
    return {...said, value: planes[q] + planes[q + 1] * x + planes[q + 2] * y};
  }
}
