// Meshes and fields as they come packed, what follows from them, and the colour of a value.
"use strict";

const VIRIDIS = ("440154 471164 482071 472e7c 443b84 3f4889 3a548c 34608d 2f6c8e 2a768e 26818e 228b8d 1f958b 1fa088 " +
  "24aa83 2fb47c 42be71 58c765 70cf57 8bd646 a8db34 c5e021 e2e418 fde725").split(" ").map(hex => parseInt(hex, 16));
// Okabe and Ito's colours, which the colour-blind tell apart, made pale so that lines stand out on them.
const NAMED = [0xa6cee8, 0xf3c887, 0x94d3bd, 0xf5ec9c, 0xe6bfd6, 0x7fb2d3, 0xe9ab84, 0xd9dde2];
// Darker ones, of marks that stand out on the fields.
const MARKS = [0xd55e00, 0x0072b2, 0x009e73, 0xcc79a7, 0x882255, 0x332288, 0x999933, 0x56b4e9];
const MISSING = 0xb8bec6, PLAIN = 0xeef3f8;
const SHADES = 256;
const TYPES = {f4: Float32Array, u4: Uint32Array, u1: Uint8Array};

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
  const values = await Promise.all(packed.values.map(unpacked));
  const mesh = {name: packed.name, centre: packed.centre, x, y, nodes, outline, values};
  mesh.count = nodes.length / 3;
  mesh.edges = packed.edges ? await unpacked(packed.edges) : edgesOf(nodes, x.length);
  mesh.elements = packed.elements && await unpacked(packed.elements);
  mesh.held = packed.held && {node: await unpacked(packed.held.node), reason: await unpacked(packed.held.reason)};
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

// The planes a + b x + c y of a field at nodes, or at the points of a lattice in each element, and a function from an
// element and a point to the beginning of its plane. An element of n divisions has 2 n n places for planes: one for the
// triangle at every point of its lattice, one for the triangle across.
function planesOf(mesh, values, at) {
  const {x, y, nodes: t, count: m} = mesh, lattice = at === "lattice";
  const n = lattice ? Math.round((Math.sqrt(8 * values.length / m + 1) - 3) / 2) : 1;
  const planes = new Float64Array(6 * n * n * m), row = j => j * (n + 1) - j * (j - 1) / 2;
  const placeOf = (e, i, j) => 6 * ((e * n + j) * n + i);
  for (let e = 0; e < m; e++) {
    const a = t[e], b = t[m + e], c = t[2 * m + e];
    const ux = x[b] - x[a], uy = y[b] - y[a], vx = x[c] - x[a], vy = y[c] - y[a], det = (ux * vy - uy * vx) / n;
    const valueAt = (i, j) => values[lattice ? (row(j) + i) * m + e : i ? b : j ? c : a];
    const set = (place, i, j, from, du, dv) => {
      const gx = (du * vy - dv * uy) / det, gy = (dv * ux - du * vx) / det;
      planes[place] = from - i * du - j * dv - gx * x[a] - gy * y[a];
      planes[place + 1] = gx;
      planes[place + 2] = gy;
    };
    for (let j = 0; j < n; j++) for (let i = 0; i + j < n; i++) {
      const here = valueAt(i, j), right = valueAt(i + 1, j), above = valueAt(i, j + 1), place = placeOf(e, i, j);
      set(place, i, j, here, right - here, above - here);
      if (i + j === n - 1) continue;
      const across = valueAt(i + 1, j + 1);
      set(place + 3, i + 1, j + 1, across, across - above, across - right);
    }
  }
  const planeAt = n === 1 ? e => 6 * e : (e, px, py) => {
    const a = t[e], b = t[m + e], c = t[2 * m + e];
    const ux = x[b] - x[a], uy = y[b] - y[a], vx = x[c] - x[a], vy = y[c] - y[a], det = (ux * vy - uy * vx) / n;
    const u = ((px - x[a]) * vy - (py - y[a]) * vx) / det, v = ((py - y[a]) * ux - (px - x[a]) * uy) / det;
    const j = Math.max(0, Math.min(n - 1, Math.floor(v))), i = Math.max(0, Math.min(n - 1 - j, Math.floor(u)));
    return placeOf(e, i, j) + (i + j < n - 1 && u - i + v - j > 1 ? 3 : 0);
  };
  return {planes, planeAt};
}

const pixelOf = colour => (0xff000000 | (colour & 0xff) << 16 | colour & 0xff00 | colour >> 16) >>> 0;
const RAMP = Uint32Array.from({length: SHADES}, (_, k) => {
  const at = k / (SHADES - 1) * (VIRIDIS.length - 1), low = Math.min(Math.floor(at), VIRIDIS.length - 2);
  const [one, other] = VIRIDIS.slice(low, low + 2), share = at - low;
  const mixed = shift => Math.round((1 - share) * (one >> shift & 255) + share * (other >> shift & 255));
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
