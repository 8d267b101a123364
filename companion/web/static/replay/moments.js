// The moment shown: of a live stream, or of a log that the server plays. Both have the same interface.

import { History } from "../core/history.js";
import { words } from "../core/state.js";
import { agoText, durationText } from "../core/units.js";

export const SPEEDS = [0.5, 1, 2, 5, 10, 20, 50];
const SPANS_S = [120, 300, 600, 1800];
const MARKS_S = { 120: 30, 300: 60, 600: 120, 1800: 300 };
const SEEK_EVERY_MS = 100;
const MARK_SPACINGS_S = [5, 10, 30, 60, 120, 300, 600, 1800, 3600, 7200];

/** A live stream: now, or a moment of the last half hour. */
export class LiveMoments {
  /** Calls `changed()` when another moment is to be shown. */
  constructor(changed) {
    this.changed = changed;
    this.history = new History();
    this.newest_s = 0;
    this.shownAt_s = null; // null: now
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

  /** The state of a past moment; null while the newest is shown. */
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

  /** Shows the newest state again. */
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

  /** The marks of the timeline: [at_s, text]. */
  marks() {
    const spacing_s = MARKS_S[this.span_s];
    const count = Math.floor(this.span_s / spacing_s);
    return Array.from({ length: count }, (_, index) => {
      const ago_s = (index + 1) * spacing_s;
      return [this.newest_s - ago_s, `\u2212${agoText(ago_s)}`];
    });
  }
}

/** A log. The server plays it and seeks in it. */
export class ReplayMoments {
  constructor(send, duration_s, changed) {
    Object.assign(this, { send, changed });
    this.duration_s = duration_s ?? 0;
    this.at_s = 0;
    this.playing = true;
    this.speed = 1;
    this.isPast = false; // a replay has no live state to differ from
    this.shown = null;
    this.changes = [];
    this.wanted_s = null;
    this.sentAt_ms = -Infinity;
    this.timer = null;
  }

  /** Takes the changes over the whole log, as the server sends them: [at_s, layer, words]. */
  setLayers(layers) {
    const usable = (Array.isArray(layers) ? layers : []).filter((entry) => Number.isFinite(entry?.[0]));
    const change = ([at_s, layer, text]) => ({ at_s, layer, words: words(text) ?? "", time_unix_s: null });
    this.changes = usable.map(change);
    this.changed();
  }

  record(state) {
    const { replay } = state;
    if (replay === null) return;
    this.duration_s = replay.duration_s ?? this.duration_s;
    if (this.wanted_s === null) this.at_s = replay.at_s ?? this.at_s;
    this.playing = replay.playing;
    this.speed = replay.speed ?? this.speed;
  }

  get from_s() {
    return 0;
  }

  get to_s() {
    return Math.max(this.duration_s, 1);
  }

  get label() {
    return `${durationText(this.at_s)} / ${durationText(this.duration_s)}`;
  }

  show(at_s) {
    this.at_s = Math.min(Math.max(at_s, 0), this.duration_s);
    this.wanted_s = this.at_s;
    // A drag changes the moment faster than the server should seek: send the newest every tenth of a second.
    const wait_ms = this.sentAt_ms + SEEK_EVERY_MS - performance.now();
    this.timer ??= setTimeout(() => this.seek(), Math.max(0, wait_ms));
    this.changed();
  }

  seek() {
    this.timer = null;
    this.sentAt_ms = performance.now();
    this.send({ seek_s: this.wanted_s });
    this.wanted_s = null;
  }

  step(step_s) {
    this.show(this.at_s + step_s);
  }

  first() {
    this.show(0);
  }

  last() {
    this.show(this.duration_s);
  }

  togglePlay() {
    if (!this.playing && this.at_s >= this.duration_s - 0.2) this.show(0);
    this.playing = !this.playing;
    this.send({ play: this.playing });
    this.changed();
  }

  setSpeed(speed) {
    this.speed = speed;
    this.send({ speed });
    this.changed();
  }

  /** Sets the next faster (+1) or slower (-1) speed. */
  shiftSpeed(by) {
    const nearest = SPEEDS.findIndex((speed) => speed >= this.speed);
    this.setSpeed(SPEEDS[Math.min(Math.max((nearest < 0 ? SPEEDS.length : nearest) + by, 0), SPEEDS.length - 1)]);
  }

  marks() {
    const spacing_s = MARK_SPACINGS_S.find((spacing) => this.to_s / spacing <= 8) ?? MARK_SPACINGS_S.at(-1);
    const count = Math.floor(this.to_s / spacing_s);
    return Array.from({ length: count + 1 }, (_, index) => [index * spacing_s, durationText(index * spacing_s)]);
  }
}
