// Quantities as text, in the chosen units: heights, distances, speeds, courses, times.

export const UNKNOWN = "–";
const FOOT_M = 0.3048;
const NAUTICAL_MILE_M = 1852;
const KNOT_MPS = NAUTICAL_MILE_M / 3600;
const MINUS = "\u2212"; // as wide as "+", so that columns stay aligned

/** A number with its sign written out. */
function signed(value, digits = 0, width = 1) {
  const text = Math.abs(value).toFixed(digits).padStart(width, "0");
  return (value < 0 && Number(text) !== 0 ? MINUS : "+") + text;
}

export function heightText(height_m, units) {
  if (height_m === null) return UNKNOWN;
  const value = units.height === "ft" ? height_m / FOOT_M : height_m;
  return `${Math.round(value)}`.replace("-", MINUS);
}

export function relativeHeightText(height_m, units) {
  if (height_m === null) return UNKNOWN;
  return signed(units.height === "ft" ? height_m / FOOT_M : height_m);
}

/** The height tag of a symbol: hundreds of feet in two digits as on a TCAS, or whole metres. */
export function relativeHeightTag(height_m, units) {
  if (height_m === null) return "";
  return units.height === "ft" ? signed(height_m / FOOT_M / 100, 0, 2) : signed(height_m);
}

export function climbText(climb_mps, units) {
  if (climb_mps === null) return UNKNOWN;
  if (units.height === "ft") return signed(Math.round((climb_mps / FOOT_M) * 6) * 10);
  return signed(climb_mps, 1);
}

export function climbUnit(units) {
  return units.height === "ft" ? "ft/min" : "m/s";
}

export function speedText(speed_mps, units) {
  if (speed_mps === null) return UNKNOWN;
  const text = units.distance === "nm" ? (speed_mps / KNOT_MPS).toFixed(0) : speed_mps.toFixed(1);
  return text.replace("-", MINUS);
}

export function speedUnit(units) {
  return units.distance === "nm" ? "kt" : "m/s";
}

/** The large unit of distance [m]; ranges are multiples of it. */
export function distanceUnit_m(units) {
  return units.distance === "nm" ? NAUTICAL_MILE_M : 1000;
}

export function distanceText(distance_m, units) {
  if (distance_m === null) return UNKNOWN;
  if (units.distance === "km" && Math.abs(distance_m) < 1000) return `${Math.round(distance_m)} m`;
  const value = distance_m / distanceUnit_m(units);
  return `${value.toFixed(Math.abs(value) < 10 ? 2 : 1)} ${units.distance === "nm" ? "NM" : "km"}`;
}

/** A range in its shortest form: "2.5 km", "500 m". */
export function rangeText(range_m, units) {
  if (units.distance === "km" && range_m < 1000) return `${Math.round(range_m)} m`;
  const value = Number((range_m / distanceUnit_m(units)).toPrecision(3));
  return `${value} ${units.distance === "nm" ? "NM" : "km"}`;
}

export function courseText(course_deg) {
  if (course_deg === null) return UNKNOWN;
  return String(((Math.round(course_deg) % 360) + 360) % 360).padStart(3, "0");
}

/** Minutes and seconds: "0:23", "12:05". */
export function durationText(duration_s) {
  if (duration_s === null) return UNKNOWN;
  const whole_s = Math.max(0, Math.floor(duration_s));
  return `${Math.floor(whole_s / 60)}:${String(whole_s % 60).padStart(2, "0")}`;
}

/** The time to the closest approach, as everywhere on the page: "0:23", or "passed". */
export function countdownText(time_s) {
  return time_s !== null && time_s < 0 ? "passed" : durationText(time_s);
}

/** A time ago, to follow a minus: "02:13". */
export function agoText(ago_s) {
  return durationText(Math.round(ago_s)).padStart(5, "0");
}

export function clockText(time_unix_s) {
  const time = new Date((time_unix_s ?? NaN) * 1000);
  return Number.isNaN(time.getTime()) ? "--:--:--" : time.toISOString().slice(11, 19);
}

/** A bearing as hours of a clock: 12 is straight ahead. */
export function clockHour(bearing_deg, course_deg) {
  if (bearing_deg === null || course_deg === null) return null;
  return (((Math.round((bearing_deg - course_deg) / 30) % 12) + 11) % 12) + 1;
}
