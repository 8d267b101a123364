// The page: receives states and draws one of them, on the map and in the panels.

import { find, setAttribute, setData, setText, show } from "./core/dom.js";
import { addressOf, getJson } from "./core/server.js";
import { Settings } from "./core/settings.js";
import { readState } from "./core/state.js";
import { Stream } from "./core/stream.js";
import { bearingOf, byUrgency, nameOf } from "./core/tracks.js";
import { FlownPath } from "./map/plan.js";
import { Scope } from "./map/scope.js";
import { ConcernsPanel } from "./panels/concerns.js";
import { Controls, listenToKeys } from "./panels/controls.js";
import { DecisionBar, DecisionList } from "./panels/decision.js";
import { DetailsPanel } from "./panels/details.js";
import { FlightPanel } from "./panels/flight.js";
import { HealthPanels } from "./panels/health.js";
import { MembersPanel } from "./panels/members.js";
import { ReceiversPanel } from "./panels/receivers.js";
import { RolePanel } from "./panels/role.js";
import { TrafficTable } from "./panels/traffic_table.js";
import { LiveMoments, ReplayMoments } from "./replay/moments.js";
import { ReplayControls, Timeline } from "./replay/timeline.js";

const TABLE_EVERY_MS = 500; // tables that change faster cannot be read
const STALE_S = 1.5;

class Display {
  constructor() {
    this.newest = null; // the last state received
    this.selected = "own";
    this.selectedName = null;
    this.follow = null;
    this.statesDrawn = 0;
    this.tablesDrawnAt_ms = -Infinity;
    this.drawn = null; // the state on the canvas
    this.frameRequested = false; // a drawing is due at the next animation frame
    this.tablesDue = false; // the last state came too soon for the tables
    this.settings = new Settings((name) => this.settingChanged(name));
    this.scope = new Scope(find("canvas"), this.settings, {
      redraw: () => this.redraw(),
      onSelect: (key) => this.select(key),
    });
    this.flownPath = new FlownPath();
    this.moments = new LiveMoments(() => this.redraw());
    this.makePanels();
    listenToKeys(this);
    this.stream = new Stream(new URL(addressOf("ws"), document.baseURI.replace(/^http/, "ws")), {
      onFrame: (text) => this.receive(text),
      onOpen: () => this.readInfo(),
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
    this.receivers = new ReceiversPanel();
    this.concerns = new ConcernsPanel(this.settings);
    this.role = new RolePanel();
    this.members = new MembersPanel();
    this.table = new TrafficTable(this.settings, (key) => this.select(key));
    this.details = new DetailsPanel(this.settings);
    this.decisions = new DecisionList((at_s) => this.moments.show(at_s));
    find("live-button").addEventListener("click", () => this.moments.live?.());
    find("follow").addEventListener("click", () => this.toggleFollow());
    find("select-own").addEventListener("click", () => this.select("own"));
  }

  /** Reads the kind of stream: at every connection, since the server may have been restarted as another kind. */
  async readInfo() {
    const info = await getJson("api/info");
    if (info === null) return;
    setText(find("title"), typeof info.title === "string" ? info.title : "");
    document.title = info.title ? `${info.title} – Companion` : "Companion";
    this.settings.suggest("height", info.height_unit);
    this.members.offer(info.members);
    this.role.offer(info.may_command === true && info.kind === "live");
    if ((info.kind === "replay") !== this.moments instanceof ReplayMoments) this.changeKind(info);
    if (info.kind === "replay") this.moments.setLayers((await getJson("api/timeline"))?.layers);
  }

  changeKind(info) {
    this.flownPath = new FlownPath();
    const changed = () => this.redraw();
    if (info.kind === "replay") {
      this.moments = new ReplayMoments((message) => this.stream.send(message), info.duration_s, changed);
      this.replayControls ??= new ReplayControls(this.moments);
      this.replayControls.replay = this.moments;
    } else this.moments = new LiveMoments(changed);
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
    this.flownPath.record(state.own, at_s);
    this.bar.announce(state);
    this.redraw();
  }

  /** False while no states are due: a paused replay sends none. */
  get expecting() {
    return this.newest?.replay?.playing !== false;
  }

  get shown() {
    return this.moments.shown ?? this.newest;
  }

  /** Draws at the next animation frame, once for any number of calls. */
  redraw() {
    if (this.frameRequested || this.timeline === undefined) return;
    this.frameRequested = true;
    requestAnimationFrame(() => {
      this.frameRequested = false;
      this.draw();
    });
  }

  draw() {
    const state = this.shown;
    if (state === null) return;
    const ordered = byUrgency(state);
    const { selected, follow } = this;
    this.scope.draw(state, { ordered, selected, follow, flown: this.flownPath.until(this.moments.at_s) });
    this.bar.update(state);
    this.flight.update(state);
    this.timeline.draw(this.scope.palette);
    this.replayControls?.update();
    this.drawBanners(state);
    this.tablesDue = performance.now() - this.tablesDrawnAt_ms < TABLE_EVERY_MS;
    if (!this.tablesDue) this.drawTables(state, ordered);
    if (state !== this.drawn) this.statesDrawn += 1;
    this.drawn = state;
    setData(document.documentElement, "ready", true);
  }

  drawTables(state, ordered) {
    this.tablesDrawnAt_ms = performance.now();
    this.bar.updateClosest(state); // with the tables: one countdown on the whole page
    this.table.update(ordered, this.selected, (track) => bearingOf(state.own, track));
    const entry = ordered.find(({ track }) => track.track === this.selected);
    if (entry !== undefined) this.selectedName = nameOf(entry.track);
    const lostName = this.selected === "own" || entry !== undefined ? null : this.selectedName;
    this.details.update(state, entry?.track ?? null, entry?.threat ?? null, this.follow === this.selected, lostName);
    this.health.update(state);
    this.receivers.update(state);
    this.concerns.update(state);
    this.role.update(this.newest.companion.role);
    this.decisions.update(this.moments.changes, this.moments.at_s);
    setData(document.documentElement, "selected", entry === undefined ? "own" : "other");
    this.controls.updateRange();
    setAttribute(find("canvas"), "aria-label", this.describe(state));
  }

  describe(state) {
    const around = state.own === null ? "own position unknown" : `range ${find("range").textContent}`;
    return `Traffic display, ${around}, ${state.tracks.length} aircraft, layer ${state.decision.layer ?? "unknown"}`;
  }

  drawBanners(state) {
    const { isPast, label } = this.moments;
    setData(document.documentElement, "past", isPast);
    show(find("past"), isPast);
    if (isPast) {
      setText(find("past-label"), `PAST ${label}`);
      const { layer } = this.newest.decision;
      setText(find("past-now"), `now: ${(layer ?? "unknown").toUpperCase()}`);
      setData(find("past-now"), "alarm", layer === "outer" || layer === "inner");
    }
    show(find("no-position"), state.own === null);
    setText(find("no-position"), "NO POSITION: our own position is unknown");
  }

  /** Marks the page as stale when no data arrives: an old picture must not look like a new one. Also draws tables that
   * are still due when no further state follows. */
  watch() {
    const silent_s = this.stream.silent_s;
    const stale = !this.stream.open || (silent_s > STALE_S && this.expecting);
    const visible = stale && silent_s > STALE_S;
    if (visible !== this.timeline.stale) {
      setText(find("announcer"), visible ? "No data" : "Data received again");
      this.timeline.stale = visible;
      this.redraw();
    } else if (this.tablesDue) this.redraw();
    setData(document.documentElement, "stale", visible);
    show(find("no-data"), visible);
    if (visible) setText(find("no-data"), this.staleText(Math.floor(silent_s)));
  }

  staleText(silent_s) {
    const { retryIn_s, open } = this.stream;
    if (open) return `NO DATA FOR ${silent_s} s: connected, but nothing received`;
    const doing = retryIn_s === null ? "connecting" : `trying again in ${retryIn_s.toFixed(1)} s`;
    return `NO DATA FOR ${silent_s} s: ${doing}`;
  }

  settingChanged(name) {
    if (this.timeline === undefined) return;
    if (name === "theme") this.scope.readColours();
    this.controls.update();
    this.redrawAll();
  }

  /** Draws the tables at once, so that keys feel immediate on a slow screen; the map at the next animation frame. */
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

  /** Selects the next (+1) or previous (-1) aircraft by urgency; ours comes before the first. */
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
