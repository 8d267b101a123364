// The page: states come in from the stream, one of them is shown, on the scope and in the panels.

import { Controls } from "./controls.js";
import { DecisionBar } from "./decision.js";
import { DecisionList } from "./decisions.js";
import { bearingOf, DetailsPanel } from "./details.js";
import { find, mark, put, show } from "./dom.js";
import { FlightPanel } from "./flight.js";
import { HealthPanels } from "./health.js";
import { listenToKeys } from "./keys.js";
import { Past } from "./past.js";
import { Path } from "./path.js";
import { Replay } from "./replay.js";
import { RolePanel } from "./role.js";
import { Scope } from "./scope.js";
import { Settings } from "./settings.js";
import { byUrgency, nameOf, readState } from "./state.js";
import { Stream } from "./stream.js";
import { ReplayControls, Timeline } from "./timeline.js";
import { TrafficTable } from "./traffic_table.js";

const TABLE_EVERY_MS = 500; // faster than that nobody reads a table
const STALE_S = 1.5;

class Display {
  constructor() {
    this.newest = null; // the last state that came
    this.selected = "own";
    this.selectedName = null;
    this.follow = null;
    this.statesDrawn = 0;
    this.tablesDrawnAt_ms = -Infinity;
    this.drawn = null; // the state that is on the canvas
    this.waiting = false; // for the next picture of the screen
    this.tablesWait = false; // for their turn
    this.settings = new Settings((name) => this.settingChanged(name));
    this.scope = new Scope(find("canvas"), this.settings, {
      redraw: () => this.redraw(),
      onSelect: (key) => this.select(key),
    });
    this.path = new Path();
    this.moments = new Past(() => this.redraw());
    this.makePanels();
    listenToKeys(this);
    this.stream = new Stream(new URL("ws", document.baseURI.replace(/^http/, "ws")), {
      onFrame: (text) => this.receive(text),
      onOpen: () => this.ask(),
      expecting: () => this.expecting,
    });
    setInterval(() => this.watch(), 250);
  }

  makePanels() {
    this.timeline = new Timeline(() => this.redraw());
    this.timeline.source = this.moments;
    this.controls = new Controls(this.settings, this.scope);
    this.bar = new DecisionBar();
    this.flight = new FlightPanel(this.settings);
    this.health = new HealthPanels();
    this.role = new RolePanel();
    this.table = new TrafficTable(this.settings, (key) => this.select(key));
    this.details = new DetailsPanel(this.settings);
    this.decisions = new DecisionList((at_s) => this.moments.show(at_s));
    find("live-button").addEventListener("click", () => this.moments.live?.());
    find("follow").addEventListener("click", () => this.toggleFollow());
    find("select-own").addEventListener("click", () => this.select("own"));
  }

  /** What kind of stream it is; asked at every connection, for the server may have been started anew. */
  async ask() {
    const info = await getJson("api/info");
    if (info === null) return;
    put(find("title"), typeof info.title === "string" ? info.title : "");
    document.title = info.title ? `${info.title} – Companion` : "Companion";
    this.settings.suggest("height", info.height_unit);
    this.role.offer(info.may_command === true && info.kind === "live");
    if ((info.kind === "replay") !== this.moments instanceof Replay) this.changeKind(info);
    if (info.kind === "replay") this.moments.setLayers((await getJson("api/timeline"))?.layers);
  }

  changeKind(info) {
    this.path = new Path();
    const changed = () => this.redraw();
    if (info.kind === "replay") {
      this.moments = new Replay((message) => this.stream.send(message), info.duration_s, changed);
      this.replayControls ??= new ReplayControls(this.moments);
      this.replayControls.replay = this.moments;
    } else this.moments = new Past(changed);
    show(find("replay-controls"), info.kind === "replay");
    this.timeline.source = this.moments;
    this.redraw();
  }

  receive(text) {
    const state = readState(text);
    if (state === null) return;
    this.newest = state;
    const at_s = state.replay?.at_s ?? performance.now() / 1000;
    this.moments.record(state, at_s);
    this.path.record(state.own, at_s);
    this.bar.announce(state);
    this.redraw();
  }

  /** Should states be coming? A replay that stands still says nothing. */
  get expecting() {
    return this.newest?.replay?.playing !== false;
  }

  get shown() {
    return this.moments.shown ?? this.newest;
  }

  /** Draws once before the next picture of the screen, however often it is asked. */
  redraw() {
    if (this.waiting || this.timeline === undefined) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw();
    });
  }

  draw() {
    const state = this.shown;
    if (state === null) return;
    const ordered = byUrgency(state);
    const { selected, follow } = this;
    this.scope.draw(state, { ordered, selected, follow, flown: this.path.until(this.moments.at_s) });
    this.bar.update(state);
    this.flight.update(state);
    this.timeline.draw(this.scope.palette);
    this.replayControls?.update();
    this.drawBanners(state);
    this.tablesWait = performance.now() - this.tablesDrawnAt_ms < TABLE_EVERY_MS;
    if (!this.tablesWait) this.drawTables(state, ordered);
    if (state !== this.drawn) this.statesDrawn += 1;
    this.drawn = state;
    mark(document.documentElement, "ready", true);
  }

  drawTables(state, ordered) {
    this.tablesDrawnAt_ms = performance.now();
    this.table.update(ordered, this.selected, (track) => bearingOf(state.own, track));
    const entry = ordered.find(({ track }) => track.track === this.selected);
    if (entry !== undefined) this.selectedName = nameOf(entry.track);
    const lostName = this.selected === "own" || entry !== undefined ? null : this.selectedName;
    this.details.update(state, entry?.track ?? null, entry?.threat ?? null, this.follow === this.selected, lostName);
    this.health.update(state);
    this.role.update(this.newest.companion.role);
    this.decisions.update(this.moments.changes, this.moments.at_s);
    mark(document.documentElement, "selected", entry === undefined ? "own" : "other");
    this.controls.updateRange();
    find("canvas").setAttribute("aria-label", this.describe(state));
  }

  describe(state) {
    const around = state.own === null ? "own position unknown" : `range ${find("range").textContent}`;
    return `Traffic display, ${around}, ${state.tracks.length} aircraft, layer ${state.decision.layer ?? "unknown"}`;
  }

  drawBanners(state) {
    const { isPast, label } = this.moments;
    mark(document.documentElement, "past", isPast);
    show(find("past"), isPast);
    if (isPast) {
      put(find("past-label"), `PAST ${label}`);
      const { layer } = this.newest.decision;
      put(find("past-now"), `now: ${(layer ?? "unknown").toUpperCase()}`);
      mark(find("past-now"), "alarm", layer === "outer" || layer === "inner");
    }
    show(find("no-position"), state.own === null);
    put(find("no-position"), "NO POSITION: where our own aircraft is, is not known");
  }

  /** Says when nothing comes any more: an old picture must not look like a new one. The tables get their turn even when
   * nothing follows the state that was too soon for them. */
  watch() {
    const silent_s = this.stream.silent_s;
    const stale = !this.stream.open || (silent_s > STALE_S && this.expecting);
    const visible = stale && silent_s > STALE_S;
    if (visible !== this.timeline.stale) {
      put(find("announcer"), visible ? "No data" : "Data again");
      this.timeline.stale = visible;
      this.redraw();
    } else if (this.tablesWait) this.redraw();
    mark(document.documentElement, "stale", visible);
    show(find("no-data"), visible);
    if (visible) put(find("no-data"), this.staleWords(Math.floor(silent_s)));
  }

  staleWords(silent_s) {
    const { retryIn_s, open } = this.stream;
    if (open) return `NO DATA FOR ${silent_s} s: connected, but nothing comes`;
    const doing = retryIn_s === null ? "connecting" : `trying again in ${retryIn_s.toFixed(1)} s`;
    return `NO DATA FOR ${silent_s} s: ${doing}`;
  }

  settingChanged(name) {
    if (this.timeline === undefined) return;
    if (name === "theme") this.scope.readColours();
    this.controls.update();
    this.redrawAll();
  }

  /** The words at once, that a key is answered however busy the screen is; the picture as soon as it can be. */
  redrawAll() {
    const state = this.shown;
    if (state !== null) this.drawTables(state, byUrgency(state));
    this.redraw();
  }

  select(key) {
    this.selected = key;
    if (this.follow !== null) this.follow = key === "own" ? null : key;
    this.redrawAll();
  }

  /** The aircraft after the selected one in the order of urgency; ours comes before the first. */
  selectNext(by) {
    if (this.shown === null) return;
    const keys = ["own", ...byUrgency(this.shown).map(({ track }) => track.track)];
    const index = Math.max(0, keys.indexOf(this.selected));
    this.select(keys[(index + by + keys.length) % keys.length]);
  }

  toggleFollow() {
    this.follow = this.follow === null && this.selected !== "own" ? this.selected : null;
    this.redrawAll();
  }

  step(step_s) {
    this.moments.step(step_s);
  }
}

async function getJson(path) {
  try {
    const answer = await fetch(path, { cache: "no-store" });
    return answer.ok ? await answer.json() : null;
  } catch {
    return null; // asked again at the next connection
  }
}

const display = new Display();

window.companionDisplay = Object.freeze({
  get statesDrawn() {
    return display.statesDrawn;
  },
  get newestSequence() {
    return display.newest?.sequence ?? null;
  },
  get tracksDrawn() {
    return display.scope.tracksDrawn;
  },
  get shownTime() {
    return display.shown?.time_unix_s ?? null;
  },
});
