// The geometry of the decision: both layers around us; well clear and collision cone of each threat.

import { layerColour } from "../core/palette.js";
import { drawArrowHead } from "./symbols.js";
import { radians } from "./view.js";

function circle({ pen }, [x, y], radius_px) {
  pen.beginPath();
  pen.arc(x, y, Math.max(radius_px, 0), 0, 2 * Math.PI);
}

/** Both layers: outer dashed, inner solid, so that they differ without colour. */
function drawVolumes(frame) {
  const { pen, view, palette, state, labels } = frame;
  const own = view.place([0, 0]);
  const { outer_m, inner_m } = state.volumes;
  const { layer } = state.decision;
  const draw = (radius_m, name, active, dash) => {
    if (radius_m === null) return;
    const radius_px = radius_m * view.scale_pxpm;
    const colour = active ? layerColour(palette, name) : palette.edge;
    circle(frame, own, radius_px);
    pen.strokeStyle = colour;
    pen.lineWidth = active ? 2.2 : 1.3;
    pen.setLineDash(dash);
    pen.stroke();
    pen.setLineDash([]);
    if (radius_px < 28) return;
    const style = { colour, size_px: 10, weight: active ? 700 : 500 };
    labels.write(name.toUpperCase(), own[0] - radius_px * 0.7071, own[1] + radius_px * 0.7071, style);
  };
  draw(outer_m, "outer", layer === "outer" || layer === "inner", [9, 5]);
  draw(inner_m, "inner", layer === "inner", []);
}

function drawWellClear(frame) {
  const { pen, view, palette, places } = frame;
  const radius_m = frame.state.volumes.well_clear_horizontal_m;
  if (radius_m === null) return;
  for (const threat of frame.state.decision.threats) {
    const place = places.get(threat.track);
    if (place === undefined) continue;
    const colour = layerColour(palette, threat.layer, palette.traffic);
    circle(frame, place, radius_m * view.scale_pxpm);
    pen.fillStyle = pen.strokeStyle = colour;
    pen.globalAlpha = 0.1;
    pen.fill();
    pen.globalAlpha = 1;
    pen.lineWidth = 1.6;
    pen.stroke();
  }
}

function sector({ pen, view }, apex, axis_deg, half_deg, reach_px) {
  const half = Math.min(Math.max(half_deg, 0), 180);
  const axis = view.angle(axis_deg);
  pen.beginPath();
  if (half < 180) pen.moveTo(...apex);
  pen.arc(...apex, reach_px, axis - radians(half), axis + radians(half));
  if (half < 180) pen.closePath();
}

/** The cone, the transition domain around it (the hysteresis for leaving the cone), and the relative course. */
function drawCone(frame, cone) {
  const { pen, view, palette, state, places } = frame;
  const apex = view.place([0, 0]);
  const threat = state.decision.threats.find((each) => each.track === cone.track);
  const colour = layerColour(palette, threat?.layer, palette.traffic);
  const target = places.get(cone.track);
  const distance_px = target === undefined ? view.radius_px : Math.hypot(target[0] - apex[0], target[1] - apex[1]);
  const beyond_px = (state.volumes.well_clear_horizontal_m ?? 0) * view.scale_pxpm;
  const reach_px = Math.max(distance_px + beyond_px, 60);
  const transition_deg = cone.half_angle_deg + (cone.transition_deg ?? 0);
  pen.strokeStyle = pen.fillStyle = colour;
  pen.lineWidth = 1.1;
  sector(frame, apex, cone.bearing_deg, transition_deg, reach_px);
  pen.globalAlpha = 0.06;
  pen.fill();
  pen.globalAlpha = 0.8;
  pen.setLineDash([3, 4]);
  pen.stroke();
  pen.setLineDash([]);
  sector(frame, apex, cone.bearing_deg, cone.half_angle_deg, reach_px);
  pen.globalAlpha = 0.1;
  pen.fill();
  pen.globalAlpha = 1;
  pen.stroke();
  if (cone.relative_course_deg !== null) drawRelativeCourse(frame, apex, cone, colour, reach_px);
}

function drawRelativeCourse({ pen, view, palette, labels }, apex, cone, colour, reach_px) {
  const tip = view.along(apex, cone.relative_course_deg, reach_px * 1.06);
  pen.strokeStyle = cone.inside ? colour : palette.clear;
  pen.lineWidth = 2;
  pen.setLineDash([12, 4, 2, 4]);
  pen.beginPath();
  pen.moveTo(...apex);
  pen.lineTo(...tip);
  pen.stroke();
  pen.setLineDash([]);
  drawArrowHead(pen, tip, view.angle(cone.relative_course_deg), 9);
  const end = view.along(apex, cone.relative_course_deg, reach_px * 1.06 + 14);
  labels.write(cone.inside ? "REL IN" : "REL OUT", ...end, { colour: pen.strokeStyle, size_px: 10, weight: 700 });
}

export function drawThreats(frame) {
  if (frame.state.own === null) return;
  drawVolumes(frame);
  for (const cone of frame.state.cones) drawCone(frame, cone);
  drawWellClear(frame);
}
