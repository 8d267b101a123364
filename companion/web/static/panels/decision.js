// The decision: the bar at the top, and the list of all changes of layer.

import { find, make, setAttribute, setData, setText, show } from "../core/dom.js";
import { lastBefore } from "../core/history.js";
import { mostUrgent, nameOf } from "../core/tracks.js";
import { clockText, durationText } from "../core/units.js";

const WORDS = { clear: "CLEAR", outer: "OUTER", inner: "INNER" };
const MARKS = { clear: "clear", outer: "caution", inner: "warning" };
const MOST = 60; // decisions in the list

/** Layer, reason, time to the closest approach; mode, role and state of the supervisor. */
export class DecisionBar {
  constructor() {
    this.layer = find("layer");
    this.announced = null;
  }

  update(state) {
    const { decision, aircraft, companion } = state;
    setData(this.layer, "layer", decision.layer ?? "none");
    setData(find("layer-mark"), "level", MARKS[decision.layer] ?? "none");
    setText(find("layer-word"), WORDS[decision.layer] ?? "UNKNOWN");
    setText(find("because"), decision.because);
    this.updateClosest(state);
    setText(find("mode"), aircraft.mode ?? "–");
    setText(find("role"), (companion.role ?? "–").toUpperCase());
    setText(find("companion-state"), (companion.state ?? "–").toUpperCase());
    setText(find("clock"), clockText(state.time_unix_s));
  }

  updateClosest(state) {
    const threat = mostUrgent(state);
    show(find("closest"), threat !== null);
    if (threat === null) return;
    const track = state.tracks.find((each) => each.track === threat.track);
    setText(find("closest-time"), durationText(threat.time_to_closest_s));
    setText(find("closest-name"), track === undefined ? threat.track : nameOf(track));
  }

  /** Announces to screen readers a new layer, course or text; not the distances in the reason, which always change. */
  announce({ decision, companion }) {
    const course_deg = decision.guidance?.course_deg ?? null;
    const course = course_deg === null ? "" : Math.round(course_deg / 10); // smaller changes are not announced
    const key = `${decision.layer} ${course} ${companion.last_text}`;
    if (key === this.announced) return;
    this.announced = key;
    setText(find("announcer"), `${WORDS[decision.layer] ?? "Unknown"}. ${decision.because}. ${companion.last_text}`);
  }
}

/** Every change of layer in memory, the newest first; `onChoose(at_s)` when one is chosen. */
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
  setAttribute(row.button, "aria-current", isCurrent);
  setData(row.symbol, "level", MARKS[change.layer] ?? "none");
  setText(row.when, change.time_unix_s === null ? durationText(change.at_s) : clockText(change.time_unix_s));
  const words = `${(change.layer ?? "unknown").toUpperCase()} ${change.because}`.trim();
  setText(row.words, words);
  if (row.button.title !== words) row.button.title = words;
}
