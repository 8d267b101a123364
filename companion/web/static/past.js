// Which moment of a live stream is shown: now, or one of the last half hour.

import { History } from "./history.js";
import { agoText } from "./units.js";

const SPANS_S = [120, 300, 600, 1800];
const MARKS_S = { 120: 30, 300: 60, 600: 120, 1800: 300 };

export class Past {
  /** `changed()` when another moment is to be shown. */
  constructor(changed) {
    this.changed = changed;
    this.history = new History();
    this.newest_s = 0;
    this.shownAt_s = null; // null: now
    this.scrubs = "the last half hour";
  }

  record(state, at_s) {
    this.newest_s = at_s;
    this.history.record(state, at_s);
    const first_s = this.history.first_s;
    if (this.shownAt_s !== null && this.shownAt_s < first_s) this.shownAt_s = first_s;
  }

  get span_s() {
    const length_s = this.newest_s - (this.history.first_s ?? this.newest_s);
    return SPANS_S.find((span_s) => span_s >= length_s) ?? SPANS_S.at(-1);
  }

  get from_s() {
    return this.newest_s - this.span_s;
  }

  get to_s() {
    return this.newest_s;
  }

  get at_s() {
    return this.shownAt_s ?? this.newest_s;
  }

  get isPast() {
    return this.shownAt_s !== null;
  }

  get changes() {
    return this.history.changes;
  }

  /** The state of the moment shown, when that is not now. */
  get shown() {
    return this.shownAt_s === null ? null : this.history.stateAt(this.shownAt_s);
  }

  get label() {
    return this.isPast ? `\u2212${agoText(this.newest_s - this.shownAt_s)}` : "LIVE";
  }

  show(at_s) {
    if (this.history.first_s === null) return;
    this.shownAt_s = at_s >= this.newest_s - 0.5 ? null : Math.max(at_s, this.history.first_s);
    this.changed();
  }

  step(step_s) {
    this.show(this.at_s + step_s);
  }

  live() {
    this.shownAt_s = null;
    this.changed();
  }

  first() {
    this.show(this.history.first_s ?? 0);
  }

  last() {
    this.live();
  }

  /** Where the strip is marked: [at_s, words]. */
  marks() {
    const spacing_s = MARKS_S[this.span_s];
    const count = Math.floor(this.span_s / spacing_s);
    return Array.from({ length: count }, (_, index) => {
      const ago_s = (index + 1) * spacing_s;
      return [this.newest_s - ago_s, `\u2212${agoText(ago_s)}`];
    });
  }
}
