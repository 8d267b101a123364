// Mission, fences, the predicted path, and the path flown in the last minutes.

import { KEPT_S, lastBefore } from "../core/history.js";
import { offset_m } from "./view.js";

const DRAWN_S = 600;
const SPACING_S = 1;
const FASTEST_MPS = 300; // a faster move is a jump: a simulation restarted, or a position found again
const GAP_S = 15; // places farther apart in time are not joined by a line

/** The flown path, one place a second. It is kept long enough to draw it at any moment of the history. */
export class FlownPath {
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

  /** The places of the ten minutes before `at_s`. */
  until(at_s) {
    return this.places.slice(lastBefore(this.places, at_s - DRAWN_S) + 1, lastBefore(this.places, at_s) + 1);
  }
}

const hasPlace = (own) => own !== null && own.lat_deg !== null && own.lon_deg !== null;

function line(pen, places) {
  pen.beginPath();
  places.forEach(([x, y], index) => (index === 0 ? pen.moveTo(x, y) : pen.lineTo(x, y)));
}

function drawFences({ pen, view, palette, state, own }) {
  for (const fence of state.fences) {
    line(pen, fence.points.map(([lat_deg, lon_deg]) => view.place(offset_m(own, lat_deg, lon_deg))));
    pen.closePath();
    pen.strokeStyle = palette.fence;
    if (fence.inclusion) {
      pen.setLineDash([]);
      pen.lineWidth = 1.6;
    } else {
      pen.fillStyle = palette.fence;
      pen.globalAlpha = 0.13;
      pen.fill();
      pen.globalAlpha = 1;
      pen.setLineDash([5, 4]);
      pen.lineWidth = 1.6;
    }
    pen.stroke();
    pen.setLineDash([]);
  }
}

function drawMission({ pen, view, palette, state, own, labels }) {
  if (state.mission === null) return;
  const { items, current } = state.mission;
  const places = items.map((item) => view.place(offset_m(own, item.lat_deg, item.lon_deg)));
  pen.strokeStyle = palette.mission;
  pen.lineWidth = 1.4;
  line(pen, places);
  pen.stroke();
  places.forEach((place, index) => {
    if (!view.sees(place, 20)) return;
    const isCurrent = items[index].sequence === current;
    pen.beginPath();
    pen.arc(...place, isCurrent ? 5 : 3.5, 0, 2 * Math.PI);
    pen.fillStyle = isCurrent ? palette.mission : palette.ground;
    pen.strokeStyle = palette.mission;
    pen.lineWidth = 1.6;
    pen.fill();
    pen.stroke();
    const style = { colour: palette.mission, size_px: 11, weight: isCurrent ? 700 : 500 };
    labels.write(String(items[index].sequence ?? index), place[0] + 12, place[1] - 9, style);
  });
}

function drawFlown({ pen, view, palette, own, flown }) {
  if (flown.length < 2) return;
  pen.strokeStyle = palette.path;
  pen.lineWidth = 1.6;
  pen.beginPath();
  flown.forEach(({ lat_deg, lon_deg, joined }, index) => {
    const place = view.place(offset_m(own, lat_deg, lon_deg));
    if (index === 0 || !joined) pen.moveTo(...place);
    else pen.lineTo(...place);
  });
  pen.lineTo(...view.place([0, 0]));
  pen.stroke();
}

/** Own path ahead, a dot every five seconds; the colour shows whether the companion or the mission commands it. */
function drawPredicted({ pen, view, palette, state }) {
  if (state.own === null || state.predicted.length === 0) return;
  const places = state.predicted.map(([north_m, east_m]) =>
    view.place([north_m - state.own.north_m, east_m - state.own.east_m]),
  );
  pen.strokeStyle = pen.fillStyle = state.decision.guidance === null ? palette.own : palette.commanded;
  pen.lineWidth = 1.4;
  line(pen, [view.place([0, 0]), ...places]);
  pen.stroke();
  for (const [x, y] of places) {
    pen.beginPath();
    pen.arc(x, y, 2.3, 0, 2 * Math.PI);
    pen.fill();
  }
}

export function drawPlan(frame) {
  if (hasPlace(frame.own)) {
    drawFences(frame);
    drawMission(frame);
    drawFlown(frame);
  }
  drawPredicted(frame);
}
