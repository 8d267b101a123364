// Reads the text of a frame into a state in which every part is present and of the right type.
// Anything missing or of the wrong type becomes null or empty here, so that no other module has to check.

const LAYERS = ["clear", "outer", "inner"];
const LEVELS = ["other", "proximate", "caution", "warning"];
const STATES = ["tentative", "confirmed", "coasted"];
const LONGEST_NAME = 12;
const LONGEST_WORDS = 300;

const object = (value) => (value !== null && typeof value === "object" && !Array.isArray(value) ? value : {});
const list = (value) => (Array.isArray(value) ? value : []);
const number = (value) => (typeof value === "number" && Number.isFinite(value) ? value : null);
const among = (value, allowed) => (allowed.includes(value) ? value : allowed[0]);
const flag = (value) => value === true;

/** Text from outside, cut to a length, without control characters and marks that change the writing direction. */
export function words(value, longest = LONGEST_WORDS) {
  if (typeof value !== "string") return null;
  const printable = value.replace(/\p{C}/gu, "").trim();
  return printable === "" ? null : printable.slice(0, longest);
}

/** The named numbers of an object, each a number or null. */
function numbers(source, names) {
  const found = {};
  for (const name of names) found[name] = number(source[name]);
  return found;
}

const OWN = [
  "lat_deg", "lon_deg", "north_m", "east_m", "altitude_m", "height_m", "course_deg", "heading_deg",
  "ground_speed_mps", "airspeed_mps", "climb_mps", "wind_north_mps", "wind_east_mps",
];
const GUIDANCE = ["course_deg", "airspeed_mps", "altitude_m", "north_m", "east_m"];
const THREAT = [
  "distance_m", "relative_altitude_m", "bearing_deg", "closing_mps", "time_to_closest_s", "miss_horizontal_m",
  "miss_vertical_m",
];
export const TRACK = [
  "north_m", "east_m", "altitude_m", "relative_altitude_m", "course_deg", "ground_speed_mps", "climb_mps",
  "turn_dps", "age_s", "distance_m", "position_sigma_m", "velocity_sigma_mps", "vertical_uncertainty_m", "alarm",
];
const CONE = ["bearing_deg", "half_angle_deg", "transition_deg", "relative_course_deg"];
const VOLUMES = ["outer_m", "inner_m", "well_clear_horizontal_m", "well_clear_vertical_m"];
const CONCERN = ["distance_m", "bearing_deg", "seconds"];
const RECEIVER = ["messages_per_s", "reports_per_s", "aircraft", "bad", "dropped", "silent_s"];
const LINK = ["frames_per_s", "lost_share", "silent_s"];
const SERVICE = ["uptime_s", "tick_ms_p99", "position_age_s"];

/** Own aircraft; null when its position is unknown. */
function readOwn(value) {
  const own = numbers(object(value), OWN);
  return own.north_m === null || own.east_m === null ? null : own;
}

function readGuidance(value) {
  return value === null || typeof value !== "object" ? null : numbers(value, GUIDANCE);
}

function readTrack(value) {
  const source = object(value);
  const key = words(source.track, 40);
  if (key === null) return null;
  return {
    track: key,
    callsign: words(source.callsign, LONGEST_NAME),
    icao: words(source.icao, LONGEST_NAME),
    kind: words(source.kind, 20) ?? "aircraft",
    level: among(source.level, LEVELS),
    state: STATES.includes(source.state) ? source.state : null,
    sources: list(source.sources).map((name) => words(name, 120)).filter(Boolean),
    ...numbers(source, TRACK),
  };
}

function readThreat(value) {
  const source = object(value);
  const key = words(source.track, 40);
  return key === null ? null : { track: key, layer: among(source.layer, LAYERS), ...numbers(source, THREAT) };
}

function readCone(value) {
  const source = object(value);
  const cone = { track: words(source.track, 40), inside: flag(source.inside), ...numbers(source, CONE) };
  return cone.bearing_deg === null || cone.half_angle_deg === null ? null : cone;
}

function readDecision(value) {
  const source = object(value);
  return {
    layer: LAYERS.includes(source.layer) ? source.layer : null,
    because: words(source.because) ?? "",
    maneuver: words(source.maneuver) ?? "",
    announced: words(source.announced) ?? "",
    guidance: readGuidance(source.guidance),
    threats: list(source.threats).map(readThreat).filter(Boolean),
  };
}

function readCondition(value) {
  const source = object(value);
  return { severity: number(source.severity) ?? 6, text: words(source.text), of_traffic: flag(source.of_traffic) };
}

const point = (value) => list(value).slice(0, 2).map(number);
const points = (value) => list(value).map(point).filter(([a, b]) => (a ?? null) !== null && (b ?? null) !== null);

function readMission(value) {
  const source = object(value);
  const items = list(source.items)
    .map((item) => numbers(object(item), ["sequence", "lat_deg", "lon_deg", "altitude_m"]))
    .filter((item) => item.lat_deg !== null && item.lon_deg !== null);
  return items.length === 0 ? null : { current: number(source.current), items };
}

function readFence(value) {
  const source = object(value);
  return { inclusion: source.inclusion !== false, points: points(source.points) };
}

function readLink(value) {
  const source = object(value);
  return { address: words(source.address, 120) ?? "?", connected: flag(source.connected), ...numbers(source, LINK) };
}

function readConcern(value) {
  const source = object(value);
  const kind = words(source.kind, 40);
  const name = words(source.name, 40) ?? "";
  return kind === null ? null : { kind, name, avoided: flag(source.avoided), ...numbers(source, CONCERN) };
}

function readReceiver(value) {
  const source = object(value);
  return {
    address: words(source.address, 120) ?? "?", title: words(source.title, 60) ?? "", lacks: words(source.lacks) ?? "",
    problem: words(source.problem), ...numbers(source, RECEIVER),
  };
}

function readReplay(value) {
  if (value === null || typeof value !== "object") return null;
  return { ...numbers(value, ["at_s", "duration_s", "speed"]), playing: flag(value.playing) };
}

/** The state of a parsed frame. */
function readParts(source) {
  const aircraft = object(source.aircraft);
  const companion = object(source.companion);
  const service = object(source.service);
  return {
    time_unix_s: number(source.time_unix_s),
    sequence: number(source.sequence),
    aircraft: {
      autopilot: words(aircraft.autopilot, 40), firmware: words(aircraft.firmware, 40),
      system_id: number(aircraft.system_id), mode: words(aircraft.mode, 40),
      armed: typeof aircraft.armed === "boolean" ? aircraft.armed : null,
    },
    companion: {
      role: words(companion.role, 20), state: words(companion.state, 40), flying: flag(companion.flying),
      last_text: words(companion.last_text) ?? "",
      conditions: list(companion.conditions).map(readCondition).filter((condition) => condition.text !== null),
    },
    own: readOwn(source.own),
    goal: readGuidance(source.goal),
    decision: readDecision(source.decision),
    predicted: points(source.predicted),
    volumes: numbers(object(source.volumes), VOLUMES),
    cones: list(source.cones).map(readCone).filter(Boolean),
    tracks: list(source.tracks).map(readTrack).filter(Boolean),
    mission: readMission(source.mission),
    fences: list(source.fences).map(readFence).filter((fence) => fence.points.length > 1),
    concerns: list(source.concerns).map(readConcern).filter(Boolean),
    links: list(source.links).map(readLink),
    receivers: list(source.receivers).map(readReceiver),
    service: { ...numbers(service, SERVICE), recording_problem: words(service.recording_problem) },
    replay: readReplay(source.replay ?? null),
  };
}

/** The state of a frame's text; null when the text is not a JSON object. */
export function readState(text) {
  let parsed;
  try {
    parsed = JSON.parse(text);
  } catch {
    return null;
  }
  if (parsed === null || typeof parsed !== "object" || Array.isArray(parsed)) return null;
  return readParts(parsed);
}
