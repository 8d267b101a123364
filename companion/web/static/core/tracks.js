// Facts derived from the traffic of a state: order of urgency, names, bearings, closest approach.

const CLIMBS_MPS = 2.5; // 500 ft/min
const RANK = { warning: 0, caution: 1, proximate: 2, other: 3 };

/** The most urgent threat: inner layer before outer, then the least time to closest approach; null without threats. */
export function mostUrgent(state) {
  const inner = (threat) => (threat.layer === "inner" ? 0 : 1);
  const order = (a, b) =>
    inner(a) - inner(b) || (a.time_to_closest_s ?? Infinity) - (b.time_to_closest_s ?? Infinity) || 0;
  return [...state.decision.threats].sort(order)[0] ?? null;
}

/** The tracks of a state with their threats, the most urgent first. */
export function byUrgency(state) {
  const threats = new Map(state.decision.threats.map((threat) => [threat.track, threat]));
  const rows = state.tracks.map((track) => ({ track, threat: threats.get(track.track) ?? null }));
  const time_s = (row) => row.threat?.time_to_closest_s ?? 1e9;
  return rows.sort(
    (a, b) =>
      RANK[a.track.level] - RANK[b.track.level] ||
      time_s(a) - time_s(b) ||
      (a.track.distance_m ?? 1e9) - (b.track.distance_m ?? 1e9) ||
      (a.track.track < b.track.track ? -1 : 1),
  );
}

/** The name of an aircraft on the display. */
export function nameOf(track) {
  return track.callsign ?? track.icao ?? track.track;
}

/** Height of home above mean sea level [m]; null when unknown. */
export function homeAltitude_m(own) {
  if (own === null || own.height_m === null || own.altitude_m === null) return null;
  return own.altitude_m - own.height_m;
}

/** A height above home with its name, or above sea while home is unknown: [name, height in metres]. */
export function namedHeight(altitude_m, own) {
  const home_m = homeAltitude_m(own);
  if (home_m === null || altitude_m === null) return ["Above sea", altitude_m];
  return ["Above home", altitude_m - home_m];
}

/** 1 for a climb and -1 for a descent of more than 500 ft/min, else 0. */
export function climbDirection(track) {
  const climb_mps = track.climb_mps ?? 0;
  return Math.abs(climb_mps) <= CLIMBS_MPS ? 0 : Math.sign(climb_mps);
}

/** The bearing of a track from us [deg]; null when either place is unknown. */
export function bearingOf(own, track) {
  if (own === null || track.north_m === null || track.east_m === null) return null;
  const bearing_deg = (Math.atan2(track.east_m - own.east_m, track.north_m - own.north_m) * 180) / Math.PI;
  return (bearing_deg + 360) % 360;
}

/** Velocity over the ground, north and east [m/s]; null when unknown. At rest no course is needed. */
function velocity_mps({ course_deg, ground_speed_mps }) {
  if (ground_speed_mps === null || (course_deg === null && ground_speed_mps > 0)) return null;
  const course = ((course_deg ?? 0) * Math.PI) / 180;
  return [ground_speed_mps * Math.cos(course), ground_speed_mps * Math.sin(course)];
}

/** Closest approach if both fly straight on, with the keys of a threat: for traffic that is not one. */
export function straightApproach(own, track) {
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
