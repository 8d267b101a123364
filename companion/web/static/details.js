// What is known of the aircraft that is selected: another one, or our own.

import { find, Pairs, put, show } from "./dom.js";
import { nameOf } from "./state.js";
import {
  climbText, climbUnit, clockHour, courseText, distanceText, durationText, heightText, relativeHeightText, speedText,
  speedUnit, UNKNOWN,
} from "./units.js";

const CLIMBS_MPS = 2.5;

/** The arrow of who climbs or descends by more than 500 ft/min. */
export function climbArrow(track) {
  const climb_mps = track.climb_mps ?? 0;
  if (Math.abs(climb_mps) <= CLIMBS_MPS) return "";
  return climb_mps > 0 ? "↑" : "↓";
}

/** The bearing of a track from us [deg]; null when either place is unknown. */
export function bearingOf(own, track) {
  if (own === null || track.north_m === null || track.east_m === null) return null;
  const bearing_deg = (Math.atan2(track.east_m - own.east_m, track.north_m - own.north_m) * 180) / Math.PI;
  return (bearing_deg + 360) % 360;
}

/** Velocity over the ground, north and east [m/s]. Who stands still needs no course. */
function velocity_mps({ course_deg, ground_speed_mps }) {
  if (ground_speed_mps === null || (course_deg === null && ground_speed_mps > 0)) return null;
  const course = ((course_deg ?? 0) * Math.PI) / 180;
  return [ground_speed_mps * Math.cos(course), ground_speed_mps * Math.sin(course)];
}

/** Of traffic that is no threat: its closest approach to us if both fly straight on, named as in a threat. */
function approach(own, track) {
  const ours = own === null ? null : velocity_mps(own);
  const theirs = velocity_mps(track);
  if (ours === null || theirs === null || bearingOf(own, track) === null) return {};
  const [north_m, east_m] = [track.north_m - own.north_m, track.east_m - own.east_m];
  const [north_mps, east_mps] = [theirs[0] - ours[0], theirs[1] - ours[1]];
  const along = north_m * north_mps + east_m * east_mps;
  const speed2 = north_mps ** 2 + east_mps ** 2;
  const closing_mps = -along / Math.max(Math.hypot(north_m, east_m), 1);
  if (speed2 < 0.01 || along >= 0) return { closing_mps };
  const time_to_closest_s = -along / speed2;
  const miss_horizontal_m = Math.hypot(north_m + north_mps * time_to_closest_s, east_m + east_mps * time_to_closest_s);
  const climbing_mps = (track.climb_mps ?? 0) - (own.climb_mps ?? 0);
  const height_m = track.relative_altitude_m;
  const miss_vertical_m = height_m === null ? null : Math.abs(height_m + climbing_mps * time_to_closest_s);
  return { closing_mps, time_to_closest_s, miss_horizontal_m, miss_vertical_m };
}

export class DetailsPanel {
  constructor(settings) {
    this.settings = settings;
    this.pairs = new Pairs(find("details"));
  }

  /** `track` is null for our own aircraft, or when the selected one is not heard any more (`lostName`). */
  update(state, track, threat, followed, lostName) {
    const isOwn = track === null;
    put(find("details-title"), isOwn ? (lostName ?? "Own aircraft") : nameOf(track));
    put(find("details-note"), isOwn ? ownNote(state, lostName) : `${track.kind}, ${track.level}`);
    show(find("follow"), !isOwn);
    show(find("select-own"), !isOwn || lostName !== null || followed);
    find("follow").setAttribute("aria-pressed", String(followed));
    put(find("follow"), followed ? "Centred" : "Centre on it");
    if (lostName !== null) this.pairs.fill([]);
    else this.pairs.fill(isOwn ? this.ownPairs(state) : this.trackPairs(state, track, threat));
  }

  trackPairs({ own }, track, threat) {
    const { settings } = this;
    const { closing_mps, time_to_closest_s, miss_horizontal_m, miss_vertical_m } = threat ?? approach(own, track);
    const bearing_deg = threat?.bearing_deg ?? bearingOf(own, track);
    const hour = clockHour(bearing_deg, own?.course_deg ?? null);
    const height = (height_m) => (height_m === null ? UNKNOWN : `${heightText(height_m, settings)} ${settings.height}`);
    const withUnit = (value_mps) => `${speedText(value_mps, settings)} ${speedUnit(settings)}`;
    const speed = (value_mps) => (value_mps === null ? UNKNOWN : withUnit(value_mps));
    return [
      ["Distance", distanceText(threat?.distance_m ?? track.distance_m, settings)],
      ["Bearing", courseText(bearing_deg) + (hour === null ? "" : `, ${hour} o'clock`)],
      ["Relative height", `${relativeHeightText(track.relative_altitude_m, settings)} ${settings.height}`],
      ["Altitude", height(track.altitude_m)],
      ["Course", courseText(track.course_deg)],
      ["Ground speed", speed(track.ground_speed_mps)],
      ["Climb", `${climbText(track.climb_mps, settings)} ${climbUnit(settings)}`],
      ["Turn", turnText(track.turn_dps)],
      ["Closing", speed(closing_mps ?? null)],
      ["Closest in", durationText(time_to_closest_s ?? null)],
      ["Miss beside", distanceText(miss_horizontal_m ?? null, settings)],
      ["Miss in height", height(miss_vertical_m ?? null)],
      ["Last heard", track.age_s === null ? UNKNOWN : `${track.age_s.toFixed(1)} s ago`],
      ["ICAO", track.icao ?? UNKNOWN],
    ];
  }

  ownPairs({ own, aircraft, service }) {
    const { settings } = this;
    const degrees = (value_deg) => (value_deg === null ? UNKNOWN : value_deg.toFixed(5));
    const seconds = (value_s) => (value_s === null ? UNKNOWN : `${value_s.toFixed(1)} s`);
    return [
      ["Latitude", degrees(own?.lat_deg ?? null)],
      ["Longitude", degrees(own?.lon_deg ?? null)],
      ["Altitude", `${heightText(own?.altitude_m ?? null, settings)} ${settings.height}`],
      ["Armed", aircraft.armed === null ? UNKNOWN : aircraft.armed ? "yes" : "no"],
      ["Position age", seconds(service.position_age_s)],
      ["System", aircraft.system_id === null ? UNKNOWN : String(aircraft.system_id)],
      ["Tick, p99", service.tick_ms_p99 === null ? UNKNOWN : `${service.tick_ms_p99.toFixed(1)} ms`],
      ["Up for", durationText(service.uptime_s)],
    ];
  }
}

function ownNote({ aircraft }, lostName) {
  if (lostName !== null) return "not heard any more";
  return [aircraft.autopilot, aircraft.firmware].filter((word) => word !== null).join(" ");
}

function turnText(turn_dps) {
  if (turn_dps === null) return UNKNOWN;
  if (Math.abs(turn_dps) < 0.1) return "none";
  return `${turn_dps > 0 ? "right" : "left"} ${Math.abs(turn_dps).toFixed(1)} °/s`;
}
