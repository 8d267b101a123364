// Our own flight: actual, commanded and mission values of course, airspeed and height.

import { find, make, Pairs, setText } from "../core/dom.js";
import { homeAltitude_m } from "../core/tracks.js";
import { climbText, climbUnit, courseText, heightText, speedText, speedUnit } from "../core/units.js";

const ROWS = ["Course", "Airspeed", "Height"];

export class FlightPanel {
  constructor(settings) {
    this.settings = settings;
    this.rows = ROWS.map((name) => makeRow(name));
    find("flight").append(...this.rows.map((row) => row.element));
    this.more = new Pairs(find("flight-more"));
  }

  update(state) {
    const { settings } = this;
    const { own, goal, decision } = state;
    const { guidance } = decision;
    const home_m = homeAltitude_m(own);
    const height = (altitude_m) => heightText(altitude_m === null ? null : altitude_m - (home_m ?? 0), settings);
    const [course, speed, level] = this.rows;
    fill(course, "° true", [own, guidance, goal], (part) => courseText(part.course_deg));
    fill(speed, speedUnit(settings), [own, guidance, goal], (part) => speedText(part.airspeed_mps, settings));
    const above = home_m === null ? "above sea" : "above home";
    fill(level, `${settings.height}, ${above}`, [own, guidance, goal], (part) => height(part.altitude_m));
    this.more.fill([
      ["Ground", `${speedText(own?.ground_speed_mps ?? null, settings)} ${speedUnit(settings)}`],
      ["Climb", `${climbText(own?.climb_mps ?? null, settings)} ${climbUnit(settings)}`],
      ["Heading", courseText(own?.heading_deg ?? null)],
      ["Wind", windText(own, settings)],
    ]);
  }
}

function makeRow(name) {
  const unit = make("span", "unit");
  const caption = make("th", "", name, unit);
  caption.scope = "row";
  const cells = [make("td"), make("td", "commanded"), make("td", "planned")];
  return { element: make("tr", "", caption, ...cells), unit, cells };
}

/** An unknown actual value shows a dash; a value that is not commanded or planned stays empty. */
function fill(row, unit, parts, text) {
  setText(row.unit, unit);
  row.cells.forEach((cell, index) => {
    setText(cell, parts[index] === null ? (index === 0 ? "–" : "") : text(parts[index]));
  });
}

/** Direction that the wind comes from, and its speed. */
function windText(own, settings) {
  const north_mps = own?.wind_north_mps ?? null;
  const east_mps = own?.wind_east_mps ?? null;
  if (north_mps === null || east_mps === null) return "–";
  const from_deg = (Math.atan2(-east_mps, -north_mps) * 180) / Math.PI;
  return `${courseText(from_deg)} / ${speedText(Math.hypot(north_mps, east_mps), settings)}`;
}
