// The bar at the top: the layer in word and shape, the time to the closest approach, the reason, who flies.

import { find, mark, put, show } from "./dom.js";
import { mostUrgent, nameOf } from "./state.js";
import { clockText, durationText } from "./units.js";

const WORDS = { clear: "CLEAR", outer: "OUTER", inner: "INNER" };
const MARKS = { clear: "clear", outer: "caution", inner: "warning" };

export class DecisionBar {
  constructor() {
    this.layer = find("layer");
    this.announced = null;
  }

  update(state) {
    const { decision, aircraft, companion } = state;
    mark(this.layer, "layer", decision.layer ?? "none");
    mark(find("layer-mark"), "level", MARKS[decision.layer] ?? "none");
    put(find("layer-word"), WORDS[decision.layer] ?? "UNKNOWN");
    put(find("because"), decision.because);
    this.updateClosest(state);
    put(find("mode"), aircraft.mode ?? "–");
    put(find("role"), (companion.role ?? "–").toUpperCase());
    put(find("companion-state"), (companion.state ?? "–").toUpperCase());
    put(find("clock"), clockText(state.time_unix_s));
  }

  updateClosest(state) {
    const threat = mostUrgent(state);
    show(find("closest"), threat !== null);
    if (threat === null) return;
    const track = state.tracks.find((each) => each.track === threat.track);
    put(find("closest-time"), durationText(threat.time_to_closest_s));
    put(find("closest-name"), track === undefined ? threat.track : nameOf(track));
  }

  /** Says a new decision to a screen reader: the distances in the reason change all the time, the command does not. */
  announce({ decision, companion }) {
    const course_deg = decision.guidance?.course_deg ?? null;
    const course = course_deg === null ? "" : Math.round(course_deg / 10); // to ten degrees: less is not worth saying
    const key = `${decision.layer} ${course} ${companion.last_text}`;
    if (key === this.announced) return;
    this.announced = key;
    put(find("announcer"), `${WORDS[decision.layer] ?? "Unknown"}. ${decision.because}. ${companion.last_text}`);
  }
}
