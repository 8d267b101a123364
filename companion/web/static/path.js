// The path that was flown: one place a second, kept a little longer than the history, drawn for ten minutes.

import { KEPT_S, lastBefore } from "./history.js";
import { offset_m } from "./view.js";

const DRAWN_S = 600;
const SPACING_S = 1;
const FASTEST_MPS = 300; // who moves faster was put elsewhere: a simulation begun anew, a position found again
const GAP_S = 15; // whoever was not seen for so long is not joined by a straight line

export class Path {
  constructor() {
    this.places = []; // {at_s, lat_deg, lon_deg, joined}
  }

  record(own, at_s) {
    if (own === null || own.lat_deg === null || own.lon_deg === null) return;
    const last = this.places.at(-1);
    if (last !== undefined && at_s < last.at_s) this.places.length = lastBefore(this.places, at_s) + 1;
    const former = this.places.at(-1);
    const since_s = at_s - (former?.at_s ?? -Infinity);
    if (since_s < SPACING_S) return;
    const joined = since_s < GAP_S && Math.hypot(...offset_m(former, own.lat_deg, own.lon_deg)) < FASTEST_MPS * since_s;
    this.places.push({ at_s, lat_deg: own.lat_deg, lon_deg: own.lon_deg, joined });
    if (this.places[0].at_s < at_s - KEPT_S - DRAWN_S) this.places.splice(0, 60);
  }

  /** The places of the ten minutes before a moment. */
  until(at_s) {
    return this.places.slice(lastBefore(this.places, at_s - DRAWN_S) + 1, lastBefore(this.places, at_s) + 1);
  }
}
