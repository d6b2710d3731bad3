// What stands beneath the picture: numbers, the colour bar, names of subdomains.
"use strict";

const digits = (value, count = 4) => {
  if (value === 0 || !Number.isFinite(value)) return String(value);
  const size = Math.abs(value);
  return size >= 1e5 || size < 1e-3 ? value.toExponential(count - 2) : String(Number(value.toPrecision(count)));
};

function made(tag, name, text = "") {
  const node = document.createElement(tag);
  node.className = name;
  node.textContent = text;
  return node;
}

const css = colour => "#" + colour.toString(16).padStart(6, "0");

function namesOf(names, colours = NAMED) {
  const list = made("ul", "names");
  names.forEach((name, k) => {
    const item = document.createElement("li"), swatch = made("span", "swatch");
    swatch.style.background = css(colours[k % colours.length]);
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
