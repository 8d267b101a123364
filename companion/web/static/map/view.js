// The projection of the map: metres north and east of our aircraft to pixels.

import { distanceUnit_m } from "../core/units.js";

const STEPS = [0.25, 0.5, 1, 1.5, 2, 3, 4, 6, 8, 12, 16, 24, 40, 80]; // ranges, in km or NM
const RING_STEPS = [1, 2, 2.5, 5, 10];
const EARTH_M_PER_DEG = 111_319.5;
const ROSE_PX = 26; // room around the rose for its labels

export const radians = (angle_deg) => (angle_deg * Math.PI) / 180;

/** Offset north and east of `from` [m], on a flat earth: the map is small. */
export function offset_m(from, lat_deg, lon_deg) {
  const turn_deg = ((lon_deg - from.lon_deg + 540) % 360) - 180;
  return [
    (lat_deg - from.lat_deg) * EARTH_M_PER_DEG,
    turn_deg * EARTH_M_PER_DEG * Math.cos(radians(from.lat_deg)),
  ];
}

export function rangeSteps_m(settings) {
  return STEPS.map((step) => step * distanceUnit_m(settings));
}

export class View {
  constructor() {
    this.width_px = 1;
    this.height_px = 1;
    this.range_m = 6000; // from the middle to the rose
    this.up_deg = 0;
    this.middle_m = [0, 0]; // north and east of our aircraft
  }

  get radius_px() {
    return Math.max(20, Math.min(this.width_px, this.height_px) / 2 - ROSE_PX);
  }

  get middle_px() {
    return [this.width_px / 2, this.height_px / 2];
  }

  get scale_pxpm() {
    return this.radius_px / this.range_m;
  }

  /** Pixels of a place, given by its offset north and east of our aircraft [m]. */
  place([north_m, east_m]) {
    const north = north_m - this.middle_m[0];
    const east = east_m - this.middle_m[1];
    const up = radians(this.up_deg);
    const ahead = north * Math.cos(up) + east * Math.sin(up);
    const right = east * Math.cos(up) - north * Math.sin(up);
    return [this.width_px / 2 + right * this.scale_pxpm, this.height_px / 2 - ahead * this.scale_pxpm];
  }

  /** A course as an angle on the canvas [rad]: 0 to the right, clockwise. */
  angle(course_deg) {
    return radians(course_deg - this.up_deg - 90);
  }

  /** The point `length_px` from another in the direction of a course. */
  along([x, y], course_deg, length_px) {
    const angle = this.angle(course_deg);
    return [x + Math.cos(angle) * length_px, y + Math.sin(angle) * length_px];
  }

  sees([x, y], margin_px = 0) {
    return x > -margin_px && y > -margin_px && x < this.width_px + margin_px && y < this.height_px + margin_px;
  }

  /** The distance between rings [m], such that two to four of them fit. */
  ringSpacing_m(settings) {
    const unit_m = distanceUnit_m(settings);
    const wanted = this.range_m / unit_m / 4.001;
    const decade = 10 ** Math.floor(Math.log10(wanted));
    return RING_STEPS.map((step) => step * decade).find((step) => step >= wanted * 0.999) * unit_m;
  }
}
