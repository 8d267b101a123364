// What is planned and what was flown: mission, fences, predicted and flown path.

import { offset_m } from "./view.js";

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

/** Own path ahead: a dot every five seconds, in the colour of who has planned it. */
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
