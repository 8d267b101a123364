// The states of the last half hour, two a second and packed, and every change of layer or manoeuvre among them.

import { TRACK } from "./state.js";

export const KEPT_S = 30 * 60;
const SPACING_S = 0.5;
const LEVELS = ["other", "proximate", "caution", "warning"];
const WIDTH = TRACK.length + 1; // numbers of a track, and its level

/** The index of the last entry at or before `at_s`; -1 if all are later. */
export function lastBefore(entries, at_s) {
  let low = 0;
  let high = entries.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (entries[middle].at_s <= at_s) low = middle + 1;
    else high = middle;
  }
  return low - 1;
}

export class History {
  constructor() {
    this.moments = [];
    this.changes = []; // {at_s, layer, announced, words, time_unix_s}
    this.names = new Map(); // by track: all moments share one object of names
    this.shared = {};
    this.seen = null; // the moment read last, with its unpacked state
  }

  /** Keeps a state that came at `at_s`, unless nothing has changed and the last kept state is too recent. */
  record(state, at_s) {
    const last = this.moments.at(-1);
    const { layer, announced, because } = state.decision;
    const before = this.changes.at(-1);
    const changed = before?.layer !== layer || before.announced !== announced;
    if (!changed && last !== undefined && at_s - last.at_s < SPACING_S) return;
    if (changed) {
      this.changes.push({ at_s, layer, announced, words: announced || because, time_unix_s: state.time_unix_s });
    }
    this.moments.push(this.pack(state, at_s));
    this.forget(at_s - KEPT_S);
  }

  forget(before_s) {
    const keep = this.moments.findIndex((moment) => moment.at_s >= before_s);
    if (keep > 0) this.moments.splice(0, keep);
    // The change before the first moment holds that moment's layer.
    const first = lastBefore(this.changes, this.moments[0].at_s);
    if (first > 0) this.changes.splice(0, first);
    if (this.names.size > 4000) this.names.clear(); // old moments keep their own names
  }

  get first_s() {
    return this.moments.length === 0 ? null : this.moments[0].at_s;
  }

  /** The last state kept at or before `at_s`, else the first; null when there is none. */
  stateAt(at_s) {
    if (this.moments.length === 0) return null;
    const moment = this.moments[Math.max(0, lastBefore(this.moments, at_s))];
    if (this.seen?.moment !== moment) this.seen = { moment, state: unpack(moment) };
    return this.seen.state;
  }

  // A hundred aircraft over half an hour are 360 000 tracks: as objects they would fill a phone's memory.
  pack(state, at_s) {
    const { tracks, ...rest } = state;
    rest.mission = this.share("mission", state.mission);
    rest.fences = this.share("fences", state.fences);
    const values = new Float32Array(tracks.length * WIDTH);
    tracks.forEach((track, row) => {
      TRACK.forEach((name, column) => (values[row * WIDTH + column] = track[name] ?? NaN));
      values[row * WIDTH + TRACK.length] = LEVELS.indexOf(track.level);
    });
    return { at_s, rest, names: tracks.map((track) => this.nameOf(track)), values };
  }

  /** The former value if the new one is equal: missions and fences hardly ever change. */
  share(part, value) {
    const text = JSON.stringify(value);
    if (this.shared[part]?.text !== text) this.shared[part] = { text, value };
    return this.shared[part].value;
  }

  nameOf({ track, callsign, icao, kind, state, sources }) {
    const known = this.names.get(track);
    const same = known?.callsign === callsign && known?.icao === icao && known?.kind === kind;
    if (same && known.state === state && known.sources.join() === sources.join()) return known;
    const name = { track, callsign, icao, kind, state, sources };
    this.names.set(track, name);
    return name;
  }
}

function unpack(moment) {
  const tracks = moment.names.map((name, row) => {
    const track = { ...name, level: LEVELS[moment.values[row * WIDTH + TRACK.length]] };
    TRACK.forEach((field, column) => {
      const value = moment.values[row * WIDTH + column];
      track[field] = Number.isNaN(value) ? null : value;
    });
    return track;
  });
  return { ...moment.rest, tracks };
}
