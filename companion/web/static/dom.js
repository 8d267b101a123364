// The few things done to the document over and over, done only when something changes.

export const find = (id) => document.getElementById(id);

/** Text alone: what others call themselves is never markup. */
export function put(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function show(element, visible) {
  if (element.hidden === visible) element.hidden = !visible;
}

export function mark(element, name, value) {
  const text = String(value);
  if (element.dataset[name] !== text) element.dataset[name] = text;
}

export function make(tag, className, ...children) {
  const element = document.createElement(tag);
  if (className) element.className = className;
  element.append(...children);
  return element;
}

/** Captions and values in a list of definitions, made once and filled again and again. */
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
      put(caption, pairs[index][0]);
      put(value, pairs[index][1]);
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
