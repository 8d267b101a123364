// Which moment of a log is shown: the server plays it, and goes where it is told.

import { words } from "./state.js";
import { durationText } from "./units.js";

export const SPEEDS = [0.5, 1, 2, 5, 10, 20, 50];
const SEEK_EVERY_MS = 100;
const MARK_SPACINGS_S = [5, 10, 30, 60, 120, 300, 600, 1800, 3600, 7200];

export class Replay {
  constructor(send, duration_s, changed) {
    Object.assign(this, { send, changed });
    this.duration_s = duration_s ?? 0;
    this.at_s = 0;
    this.playing = true;
    this.speed = 1;
    this.isPast = false; // what the server shows is what there is
    this.shown = null;
    this.changes = [];
    this.wanted_s = null;
    this.sentAt_ms = -Infinity;
    this.timer = null;
    this.scrubs = "the log";
  }

  /** The changes of layer over the whole log, as the server tells them. */
  setLayers(layers) {
    const usable = (Array.isArray(layers) ? layers : []).filter((entry) => Number.isFinite(entry?.[0]));
    this.changes = usable.map(([at_s, layer, because]) => ({ at_s, layer, because: words(because) ?? "", time_unix_s: null }));
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
    // A drag asks for more places than a server should compute: the newest in each tenth of a second is enough.
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

  /** The next faster (+1) or slower (-1) of the speeds. */
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
