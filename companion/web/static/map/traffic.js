// The traffic on the map: symbol, relative height, name, and trend vector of each track.

import { levelColour, levelFill } from "../core/palette.js";
import {
  accuracy_m, concernName, isCoasted, isTentative, isUnplacedTrack, silenceText, whyText,
} from "../core/evidence.js";
import { climbDirection, nameOf } from "../core/tracks.js";
import { relativeHeightTag } from "../core/units.js";
import { drawClimbArrow, drawObstacle, drawSelection, drawTraffic, drawUnknown } from "./symbols.js";

const STEP_S = 5;
const SYMBOL_PX = 12; // a smaller uncertainty is within the symbol
const STRAIGHT_DPS = 0.2; // a slower turn is not visible on the display

/** Pixels of each track by key; tracks without a position are left out. */
export function placesOf(state, view) {
  const places = new Map();
  if (state.own === null) return places;
  for (const track of state.tracks) {
    if (track.north_m === null || track.east_m === null) continue;
    places.set(track.track, view.place([track.north_m - state.own.north_m, track.east_m - state.own.east_m]));
  }
  return places;
}

/** The trend vector: the path in the next 30 or 60 s at the present speed and turn rate. */
export function drawTrend({ pen, view, settings }, place, mover, colour) {
  const { course_deg, ground_speed_mps, turn_dps } = mover;
  if (course_deg === null || ground_speed_mps === null || ground_speed_mps < 1) return;
  const rate_dps = Math.abs(turn_dps ?? 0) > STRAIGHT_DPS ? turn_dps : 0;
  const step_s = rate_dps === 0 ? settings.trend_s : STEP_S;
  pen.strokeStyle = colour;
  pen.lineWidth = 1.4;
  pen.beginPath();
  pen.moveTo(...place);
  let [x, y] = place;
  for (let at_s = 0; at_s < settings.trend_s; at_s += step_s) {
    const middle_deg = course_deg + rate_dps * (at_s + step_s / 2);
    [x, y] = view.along([x, y], middle_deg, ground_speed_mps * step_s * view.scale_pxpm);
    pen.lineTo(x, y);
  }
  pen.stroke();
}

/** The relative height, above the symbol for traffic above us, else below it, and the climb arrow beside it.
 * Traffic of no concern goes without where the text would cover another symbol. */
function drawHeight({ pen, palette, settings, labels, dense, selected, trafficFrom }, track, [x, y]) {
  const text = relativeHeightTag(track.relative_altitude_m, settings);
  if (text === "") return;
  const above = track.relative_altitude_m >= 0;
  const middle = above ? y - 17 : y + 17;
  const style = { colour: levelColour(palette, track.level), size_px: dense ? 11 : 12, weight: 600 };
  const must = track.level !== "other" || track.track === selected;
  if (!must && !labels.free(x - 12, middle - 5, 24, 10, trafficFrom)) return;
  pen.globalAlpha = paleness(track);
  const width = labels.write(text, x, middle, style);
  const climb = climbDirection(track);
  if (climb === 0) return;
  drawClimbArrow(pen, x + width / 2 + 6, middle, climb > 0, style.colour);
  labels.take(x + width / 2, middle - 6, 10, 12);
}

/** What is not heard any more, or was reported once, is paler. */
const paleness = (track) => (isCoasted(track) ? 0.75 : isTentative(track) ? 0.55 : 1);

/** The circle in which the aircraft is, with 95 % probability, where it is larger than the symbol. */
function drawUncertainty({ pen, palette, view }, track, place) {
  const radius_px = (accuracy_m(track) ?? 0) * view.scale_pxpm;
  if (radius_px <= SYMBOL_PX || track.kind === "obstacle") return;
  pen.beginPath();
  pen.arc(...place, radius_px, 0, 2 * Math.PI);
  pen.fillStyle = pen.strokeStyle = levelColour(palette, track.level);
  pen.globalAlpha = 0.07;
  pen.fill();
  pen.globalAlpha = 0.7;
  pen.lineWidth = 1.1;
  pen.setLineDash(isCoasted(track) ? [3, 4] : [1.5, 3]);
  pen.stroke();
  pen.setLineDash([]);
  pen.globalAlpha = 1;
}

function drawOne(frame, track, place) {
  const { pen, palette } = frame;
  const colour = levelColour(palette, track.level);
  pen.globalAlpha = paleness(track);
  const style = {
    colour, fill: levelFill(palette, track.level), ground: palette.ground, coasted: isCoasted(track),
    tentative: isTentative(track),
  };
  if (track.kind === "obstacle") drawObstacle(pen, place, track.level, style);
  else drawTraffic(pen, place, track.level, style);
  frame.labels.take(place[0] - 9, place[1] - 9, 18, 18);
  pen.globalAlpha = 1;
}

function drawName({ pen, palette, labels, selected }, track, place) {
  const chosen = track.track === selected;
  const alarming = track.level === "warning" || track.level === "caution";
  const style = {
    colour: alarming ? levelColour(palette, track.level) : palette.ink,
    size_px: alarming || chosen ? 12 : 11, weight: alarming || chosen ? 700 : 500, must: alarming || chosen,
  };
  pen.globalAlpha = alarming ? 1 : paleness(track);
  const silent = isCoasted(track) ? `${nameOf(track)} ${silenceText(track)}` : null;
  const written = silent !== null && labels.beside(track.track, silent, place, 12, { ...style, must: false });
  if (!written) labels.beside(track.track, nameOf(track), place, 12, style);
  pen.globalAlpha = 1;
}

/** Aircraft that have a place, but no track: they are not avoided. */
export function drawConcerns({ pen, palette, labels, view, state }) {
  if (state.own === null) return;
  for (const concern of state.concerns.filter(isUnplacedTrack)) {
    const place = view.along(view.place([0, 0]), concern.bearing_deg, concern.distance_m * view.scale_pxpm);
    if (!view.sees(place)) continue;
    drawUnknown(pen, place, palette.caution, palette.ground);
    labels.take(place[0] - 9, place[1] - 9, 18, 18);
    const style = { colour: palette.caution, size_px: 11, weight: 600, must: true };
    labels.beside(`concern ${concern.name}`, `${concernName(concern)} ${whyText(concern)}`, place, 12, style);
  }
}

/** Draws all tracks and returns how many are on the canvas. Symbols: the most urgent last, so that it lies on top.
 * Text: the most urgent first, so that it has the best place. */
export function drawAllTraffic(frame) {
  const { view, palette, pen, places, ordered, selected } = frame;
  const seen = ordered.filter(({ track }) => places.has(track.track) && view.sees(places.get(track.track), 30));
  for (const { track } of seen) {
    pen.globalAlpha = 0.75 * paleness(track);
    drawTrend(frame, places.get(track.track), track, levelColour(palette, track.level));
  }
  pen.globalAlpha = 1;
  for (const { track } of seen) drawUncertainty(frame, track, places.get(track.track));
  const trafficFrom = frame.labels.taken.length;
  for (const { track } of [...seen].reverse()) drawOne(frame, track, places.get(track.track));
  for (const { track } of seen) drawHeight({ ...frame, trafficFrom }, track, places.get(track.track));
  for (const { track } of seen) if (view.sees(places.get(track.track))) drawName(frame, track, places.get(track.track));
  if (places.has(selected)) drawSelection(pen, places.get(selected), palette.ink);
  return seen.length;
}

/** An arrow at the edge towards the selected aircraft when it is off the canvas. */
export function drawOffCanvas({ pen, view, palette, places, selected, labels, state }) {
  const place = places.get(selected);
  if (place === undefined || view.sees(place)) return;
  const [x, y] = view.middle_px;
  const angle = Math.atan2(place[1] - y, place[0] - x);
  const reach = Math.min((x - 16) / Math.abs(Math.cos(angle) || 1e-9), (y - 16) / Math.abs(Math.sin(angle) || 1e-9));
  const tip = [x + Math.cos(angle) * reach, y + Math.sin(angle) * reach];
  const track = state.tracks.find((each) => each.track === selected);
  pen.save();
  pen.translate(...tip);
  pen.rotate(angle);
  pen.beginPath();
  pen.moveTo(8, 0);
  pen.lineTo(-6, -7);
  pen.lineTo(-6, 7);
  pen.closePath();
  pen.fillStyle = levelColour(palette, track.level);
  pen.fill();
  pen.restore();
  const back = [tip[0] - Math.cos(angle) * 30, tip[1] - Math.sin(angle) * 18];
  labels.write(nameOf(track), ...back, { colour: palette.ink, size_px: 11, weight: 600 });
}

/** The key of the aircraft nearest to a point; "own" for ours, null when none is near. */
export function pick(places, ownPlace, [x, y], reach_px) {
  let nearest = null;
  let least_px = reach_px;
  const consider = (key, [atX, atY]) => {
    const distance_px = Math.hypot(atX - x, atY - y);
    if (distance_px < least_px) [nearest, least_px] = [key, distance_px];
  };
  for (const [key, place] of places) consider(key, place);
  if (ownPlace !== null) consider("own", ownPlace);
  return nearest;
}

/** The range [m] that shows every alarm, else the nearest three, and always our outer layer. */
export function wantedRange_m(state) {
  const distances = (levels) =>
    state.tracks
      .filter((track) => levels.includes(track.level) && track.distance_m !== null && track.kind !== "obstacle")
      .map((track) => track.distance_m)
      .sort((a, b) => a - b);
  const alarms = distances(["caution", "warning"]);
  const near = distances(["other", "proximate"]).filter((distance_m) => distance_m < 12_000);
  const shown_m = alarms.length > 0 ? alarms.at(-1) : (near[Math.min(2, near.length - 1)] ?? 5000);
  return Math.max(shown_m * 1.15, (state.volumes.outer_m ?? 0) * 1.3);
}
