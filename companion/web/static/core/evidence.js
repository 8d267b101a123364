// What is known of a track and from where: its state, sources and accuracy, in words; and what is not avoided.

import { clockHour, distanceText, heightText, speedText, speedUnit, UNKNOWN } from "./units.js";

const SILENT_S = 5; // for states without the tracks' states
const WITHIN_95 = 2.448; // a normal error in the plane is within so many sigmas of an axis in 95 of 100 cases

/** True for a track that is extrapolated, because it is not heard any more. Obstacles do not age. */
export function isCoasted(track) {
  if (track.kind === "obstacle") return false;
  return track.state === null ? (track.age_s ?? 0) > SILENT_S : track.state === "coasted";
}

export const isTentative = (track) => track.state === "tentative";

/** "coasted", "tentative" or "confirmed": for style sheets. */
export function stateOf(track) {
  if (isCoasted(track)) return "coasted";
  return isTentative(track) ? "tentative" : "confirmed";
}

export const silenceText = (track) => `not heard ${Math.round(track.age_s ?? 0)} s`;

export function stateText(track) {
  if (isCoasted(track)) return silenceText(track);
  return isTentative(track) ? "tentative: one report" : "confirmed";
}

/** The radius around the place of a track in which the aircraft is, with 95 % probability [m]; null if unknown. */
export const accuracy_m = (track) => (track.position_sigma_m === null ? null : WITHIN_95 * track.position_sigma_m);

/** Rounded to a step that suits it: "±74 m", "±1.2 km". */
export function accuracyText(track, units) {
  const radius_m = accuracy_m(track);
  return radius_m === null ? UNKNOWN : `±${distanceText(radius_m, units)}`;
}

export function velocityAccuracyText(track, units) {
  if (track.velocity_sigma_mps === null) return UNKNOWN;
  return `±${speedText(WITHIN_95 * track.velocity_sigma_mps, units)} ${speedUnit(units)}`;
}

/** How far its height may be off, beyond the margin that avoidance has for it anyway. */
export function heightErrorText(track, units) {
  const error_m = track.vertical_uncertainty_m;
  if (error_m === null) return UNKNOWN;
  return error_m < 1 ? "normal" : `${heightText(error_m, units)} ${units.height} more`;
}

/** The sources in few words: of receivers their formats, several of one with their number. */
export function sourcesInShort(track) {
  const counts = new Map();
  for (const source of track.sources) {
    const name = source.split(":", 1)[0];
    counts.set(name, (counts.get(name) ?? 0) + 1);
  }
  return [...counts].map(([name, count]) => (count === 1 ? name : `${count} ${name}`)).join(", ");
}

/** The line below the name: state unless it is confirmed, sources, accuracy, age. */
export function evidenceText(track, units) {
  if (track.kind === "obstacle") return "";
  const parts = isTentative(track) ? ["tentative"] : [];
  if (track.sources.length > 0) parts.push(sourcesInShort(track));
  if (accuracy_m(track) !== null) parts.push(accuracyText(track, units));
  if (isCoasted(track)) parts.unshift(silenceText(track));
  else if (track.age_s !== null) parts.push(`${track.age_s.toFixed(1)} s`);
  return parts.join(" · ");
}

const seconds = ({ seconds: value }) => `${Math.round(value ?? 0)} s`;
const WHY = {
  "height unknown": () => "height unknown",
  "old reports": (concern) => `reports ${seconds(concern)} old`,
  "not heard": (concern) => `not heard for ${seconds(concern)}`,
  lost: (concern) => `lost, not heard for ${seconds(concern)}`,
  "own shadow": (concern) => `our own shadow, ${seconds(concern)} late`,
  "own address flies elsewhere": () => "has our address, but flies elsewhere",
  "aircraft left out": () => "too much traffic",
};

/** Why an aircraft is of concern; an unknown kind is shown as it is. */
export const whyText = (concern) => (WHY[concern.kind] ?? (() => concern.kind))(concern);

/** Of many aircraft, their number; of one its name. */
export const concernName = (concern) =>
  concern.kind === "aircraft left out" ? `${concern.name} aircraft left out` : concern.name;

/** Where it is: "2 o'clock, 1.80 km"; empty when unknown. */
export function whereText({ bearing_deg, distance_m }, own, units) {
  if (distance_m === null) return "";
  const hour = clockHour(bearing_deg, own?.heading_deg ?? own?.course_deg ?? null);
  return (hour === null ? "" : `${hour} o'clock, `) + distanceText(distance_m, units);
}

/** True for an aircraft that the map shows with a question mark: it has a place, but no track. */
export const isUnplacedTrack = (concern) =>
  !concern.avoided && concern.distance_m !== null && concern.bearing_deg !== null && concern.kind !== "own shadow";
