// Helpers for the document. Each writes only when the value changes, to save needless layout.

export const find = (id) => document.getElementById(id);

/** Sets plain text: names that come over the air are never markup. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Sets a `data-` attribute, which style sheets and tests read. */
export function setData(element, name, value) {
  const text = String(value);
  if (element.dataset[name] !== text) element.dataset[name] = text;
}

export function setAttribute(element, name, value) {
  const text = String(value);
  if (element.getAttribute(name) !== text) element.setAttribute(name, text);
}

export function show(element, visible) {
  if (element.hidden === visible) element.hidden = !visible;
}

export function make(tag, className, ...children) {
  const element = document.createElement(tag);
  if (className) element.className = className;
  element.append(...children);
  return element;
}

/** Fits a canvas to its box on the page; returns its size in CSS pixels and the device pixels of each. */
export function fitCanvas(canvas) {
  const box = canvas.getBoundingClientRect();
  const ratio = Math.min(window.devicePixelRatio || 1, 3);
  canvas.width = Math.max(1, Math.round(box.width * ratio));
  canvas.height = Math.max(1, Math.round(box.height * ratio));
  return { box, ratio };
}

/** Captions and values in a definition list, [caption, value, whether it takes a line of its own]; its elements are made once and reused. */
export class Pairs {
  constructor(list) {
    this.list = list;
    this.cells = [];
  }

  fill(pairs) {
    while (this.cells.length < pairs.length) this.add();
    this.cells.forEach(({ pair, caption, value }, index) => {
      show(pair, index < pairs.length);
      if (index >= pairs.length) return;
      setText(caption, pairs[index][0]);
      setText(value, pairs[index][1]);
      setData(pair, "wide", pairs[index][2] === true);
    });
  }

  add() {
    const caption = make("dt");
    const value = make("dd");
    const pair = make("div", "", caption, value);
    this.list.append(pair);
    this.cells.push({ pair, caption, value });
  }
}
