// The list of decisions: every change of layer that is remembered, the newest first; each leads to its moment.

import { find, make, mark, put, show } from "./dom.js";
import { lastBefore } from "./history.js";
import { clockText, durationText } from "./units.js";

const MARKS = { clear: "clear", outer: "caution", inner: "warning" };
const MOST = 60;

export class DecisionList {
  constructor(onChoose) {
    this.onChoose = onChoose;
    this.list = find("decisions");
    this.rows = [];
  }

  update(changes, at_s) {
    const current = changes[lastBefore(changes, at_s)];
    const newest = changes.slice(-MOST).reverse();
    while (this.rows.length < newest.length) this.add();
    this.rows.forEach((row, index) => {
      show(row.element, index < newest.length);
      if (index < newest.length) fill(row, newest[index], newest[index] === current);
    });
  }

  add() {
    const [symbol, when, words] = ["mark", "when", "words"].map((name) => make("span", name));
    const button = make("button", "", symbol, when, words);
    button.type = "button";
    const row = { element: make("li", "", button), button, symbol, when, words, at_s: 0 };
    button.addEventListener("click", () => this.onChoose(row.at_s));
    this.list.append(row.element);
    this.rows.push(row);
  }
}

function fill(row, change, isCurrent) {
  row.at_s = change.at_s;
  const current = String(isCurrent);
  if (row.button.getAttribute("aria-current") !== current) row.button.setAttribute("aria-current", current);
  mark(row.symbol, "level", MARKS[change.layer] ?? "none");
  put(row.when, change.time_unix_s === null ? durationText(change.at_s) : clockText(change.time_unix_s));
  const words = `${(change.layer ?? "unknown").toUpperCase()} ${change.because}`.trim();
  put(row.words, words);
  if (row.button.title !== words) row.button.title = words;
}
