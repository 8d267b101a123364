// Details of the selected aircraft: a track, or our own.

import { find, Pairs, setAttribute, setText, show } from "../core/dom.js";
import {
  accuracyText, heightErrorText, stateOf, stateText, velocityAccuracyText,
} from "../core/evidence.js";
import { bearingOf, nameOf, namedHeight, straightApproach } from "../core/tracks.js";
import {
  climbText, climbUnit, clockHour, countdownText, courseText, distanceText, durationText, heightText,
  relativeHeightText, speedText, speedUnit, UNKNOWN,
} from "../core/units.js";

export class DetailsPanel {
  constructor(settings) {
    this.settings = settings;
    this.pairs = new Pairs(find("details"));
  }

  /** `track` is null for our own aircraft, and for a selected track that is gone (then `lostName` is its name). */
  update(state, track, threat, followed, lostName) {
    const isOwn = track === null;
    setText(find("details-title"), isOwn ? (lostName ?? "Own aircraft") : nameOf(track));
    setText(find("details-note"), isOwn ? ownNote(state, lostName) : `${track.kind}, ${track.level}, ${stateOf(track)}`);
    show(find("follow"), !isOwn);
    show(find("select-own"), !isOwn || lostName !== null || followed);
    setAttribute(find("follow"), "aria-pressed", followed);
    setText(find("follow"), followed ? "Centred" : "Centre on it");
    if (lostName !== null) this.pairs.fill([]);
    else this.pairs.fill(isOwn ? this.ownPairs(state) : this.trackPairs(state, track, threat));
  }

  trackPairs({ own }, track, threat) {
    const { settings } = this;
    const approach = threat ?? straightApproach(own, track);
    const { closing_mps, time_to_closest_s, miss_horizontal_m, miss_vertical_m } = approach;
    const bearing_deg = threat?.bearing_deg ?? bearingOf(own, track);
    const hour = clockHour(bearing_deg, own?.course_deg ?? null);
    const height = (height_m) => (height_m === null ? UNKNOWN : `${heightText(height_m, settings)} ${settings.height}`);
    const withUnit = (value_mps) => `${speedText(value_mps, settings)} ${speedUnit(settings)}`;
    const speed = (value_mps) => (value_mps === null ? UNKNOWN : withUnit(value_mps));
    const [above, above_m] = namedHeight(track.altitude_m, own);
    return [
      ["Distance", distanceText(threat?.distance_m ?? track.distance_m, settings)],
      ["Bearing", courseText(bearing_deg) + (hour === null ? "" : `, ${hour} o'clock`)],
      ["Relative height", `${relativeHeightText(track.relative_altitude_m, settings)} ${settings.height}`],
      [above, height(above_m)],
      ["Course", courseText(track.course_deg)],
      ["Ground speed", speed(track.ground_speed_mps)],
      ["Climb", `${climbText(track.climb_mps, settings)} ${climbUnit(settings)}`],
      ["Turn", turnText(track.turn_dps)],
      ["Closing speed", speed(closing_mps ?? null)],
      ["Closest in", countdownText(time_to_closest_s ?? null)],
      ["Horizontal miss", distanceText(miss_horizontal_m ?? null, settings)],
      ["Vertical miss", height(miss_vertical_m ?? null)],
      ["Last report", track.age_s === null ? UNKNOWN : `${track.age_s.toFixed(1)} s ago`],
      ["ICAO", track.icao ?? UNKNOWN],
      ["Position", accuracyText(track, settings)],
      ["Velocity", velocityAccuracyText(track, settings)],
      ["Height error", heightErrorText(track, settings)],
      ["Receiver alarm", (track.alarm ?? 0) > 0 ? `${track.alarm} of 3` : "none"],
      ["State", stateText(track), true],
      ["Sources", track.sources.join(", ") || "none heard", true],
    ];
  }

  ownPairs({ own, aircraft, service }) {
    const { settings } = this;
    const degrees = (value_deg) => (value_deg === null ? UNKNOWN : value_deg.toFixed(5));
    const seconds = (value_s) => (value_s === null ? UNKNOWN : `${value_s.toFixed(1)} s`);
    return [
      ["Latitude", degrees(own?.lat_deg ?? null)],
      ["Longitude", degrees(own?.lon_deg ?? null)],
      ["Above sea", `${heightText(own?.altitude_m ?? null, settings)} ${settings.height}`],
      ["Armed", aircraft.armed === null ? UNKNOWN : aircraft.armed ? "yes" : "no"],
      ["Position age", seconds(service.position_age_s)],
      ["System", aircraft.system_id === null ? UNKNOWN : String(aircraft.system_id)],
      ["Tick, p99", service.tick_ms_p99 === null ? UNKNOWN : `${service.tick_ms_p99.toFixed(1)} ms`],
      ["Late ticks", String(service.late_ticks ?? 0)],
      ["Reports dropped", String(service.dropped_reports ?? 0)],
      ["Reports sent on", String(service.forwarded_reports ?? 0)],
      ["Uptime", durationText(service.uptime_s)],
    ];
  }
}

function ownNote({ aircraft }, lostName) {
  if (lostName !== null) return "track lost";
  return [aircraft.autopilot, aircraft.firmware].filter((word) => word !== null).join(" ");
}

function turnText(turn_dps) {
  if (turn_dps === null) return UNKNOWN;
  if (Math.abs(turn_dps) < 0.1) return "none";
  return `${turn_dps > 0 ? "right" : "left"} ${Math.abs(turn_dps).toFixed(1)} °/s`;
}
