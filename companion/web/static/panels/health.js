// The health of the companion: its last message, the conditions that hold, its troubles, its links.

import { find, make, setData, setText, show } from "../core/dom.js";

const GRAVE_SEVERITY = 3; // MAV_SEVERITY_ERROR
const LATE_S = 2; // two heartbeats missed
const LOSSY_SHARE = 0.05;
const OLD_POSITION_S = 0.5; // with an older position the companion does not take over
const SLOW_TICK_MS = 100; // there are ten ticks a second

export class HealthPanels {
  constructor() {
    this.rows = [];
    this.list = find("links");
    this.conditions = find("conditions");
    this.shownConditions = "";
  }

  update(state) {
    setText(find("last-text"), state.companion.last_text || "No message yet");
    // Those about traffic are in the list of what is not avoided.
    this.fillConditions(state.companion.conditions.filter((condition) => !condition.of_traffic));
    const troubles = troublesOf(state);
    show(find("trouble"), troubles.length > 0);
    setText(find("trouble"), troubles.join(" · "));
    setText(find("links-note"), state.links.length === 0 ? "none" : "");
    while (this.rows.length < state.links.length) this.addRow();
    this.rows.forEach((row, index) => {
      show(row.element, index < state.links.length);
      if (index < state.links.length) fill(row, state.links[index]);
    });
  }

  fillConditions(conditions) {
    const key = JSON.stringify(conditions);
    if (key === this.shownConditions) return;
    this.shownConditions = key;
    show(this.conditions, conditions.length > 0);
    this.conditions.replaceChildren(...conditions.map(makeCondition));
  }

  addRow() {
    const [address, word, rate] = ["address", "word", "rate"].map((name) => make("span", name));
    const element = make("li", "", make("span", "dot"), address, word, rate);
    this.list.append(element);
    this.rows.push({ element, address, word, rate });
  }
}

function makeCondition({ severity, text }) {
  const element = make("li", "", text);
  setData(element, "grave", severity <= GRAVE_SEVERITY);
  return element;
}

function fill(row, link) {
  const health = healthOf(link);
  setData(row.element, "health", health);
  setText(row.address, link.address);
  setText(row.word, { good: "OK", poor: "POOR", lost: link.connected ? "SILENT" : "DOWN" }[health]);
  const frames = link.frames_per_s === null ? "–" : link.frames_per_s.toFixed(1);
  const lost = link.lost_share === null ? "–" : (link.lost_share * 100).toFixed(1);
  const silent = link.silent_s === null ? "no data yet" : `silent ${link.silent_s.toFixed(1)} s`;
  const dropped = (link.dropped ?? 0) > 0 ? `, ${link.dropped} dropped` : "";
  setText(row.rate, `${frames} frames/s, ${lost} % lost${dropped}, ${silent}`);
}

function healthOf({ connected, silent_s, lost_share }) {
  if (!connected || silent_s === null || silent_s > 5) return "lost";
  return silent_s > LATE_S || (lost_share ?? 0) > LOSSY_SHARE ? "poor" : "good";
}

function troublesOf({ service, aircraft }) {
  const troubles = [];
  if (service.recording_problem !== null) troubles.push(`Not recorded: ${service.recording_problem}`);
  const age_s = service.position_age_s ?? 0;
  if (age_s > OLD_POSITION_S) troubles.push(`Position ${age_s.toFixed(1)} s old`);
  const tick_ms = service.tick_ms_p99 ?? 0;
  if (tick_ms > SLOW_TICK_MS) troubles.push(`Decisions take ${tick_ms.toFixed(0)} ms`);
  if (aircraft.armed === false) troubles.push("Disarmed");
  return troubles;
}
