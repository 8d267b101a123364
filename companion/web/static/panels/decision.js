// The decision: the bar at the top, and the list of all changes of layer or manoeuvre.

import { find, make, setAttribute, setData, setText, show } from "../core/dom.js";
import { lastBefore } from "../core/history.js";
import { mostUrgent, nameOf } from "../core/tracks.js";
import { clockText, countdownText, durationText } from "../core/units.js";

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
    setText(find("because"), headlineOf(state));
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
    setText(find("closest-time"), countdownText(threat.time_to_closest_s));
    setText(find("closest-name"), track === undefined ? threat.track : nameOf(track));
  }

  /** Announces to screen readers a new layer, manoeuvre or text; not distances, which always change. */
  announce({ decision, companion }) {
    const words = `${WORDS[decision.layer] ?? "Unknown"}. ${decision.maneuver} ${companion.last_text}`;
    if (words === this.announced) return;
    this.announced = words;
    setText(find("announcer"), words);
  }
}

/** The manoeuvre as announced to the crew, and against whom; without one the reason for the decision. */
function headlineOf(state) {
  const { decision, companion, tracks } = state;
  const threat = mostUrgent(state);
  const track = tracks.find((each) => each.track === threat?.track);
  const name = track === undefined ? threat?.track : nameOf(track);
  if (companion.state === "suppressed" && threat !== null) return `Not avoided, mission resumed: ${name}`;
  if (decision.maneuver === "") return decision.because;
  return name === undefined ? decision.maneuver : `${decision.maneuver}: ${name}`;
}

/** Every change of layer or manoeuvre in memory, the newest first; `onChoose(at_s)` when one is chosen. */
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
  setText(row.words, `${(change.layer ?? "unknown").toUpperCase()} ${change.words}`.trim());
}
