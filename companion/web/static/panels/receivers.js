// The receivers of traffic that do not speak MAVLink: what they send, what is wrong, what they lack.

import { find, make, setData, setText, show } from "../core/dom.js";

const TEXTS = ["address", "word", "title", "rate", "problem", "bad", "lacks"];

export class ReceiversPanel {
  constructor() {
    this.rows = [];
    this.panel = find("receivers-panel");
    this.list = find("receivers");
  }

  update({ receivers }) {
    show(this.panel, receivers.length > 0);
    while (this.rows.length < receivers.length) this.addRow();
    this.rows.forEach((row, index) => {
      show(row.element, index < receivers.length);
      if (index < receivers.length) fill(row, receivers[index]);
    });
  }

  addRow() {
    const row = Object.fromEntries(TEXTS.map((name) => [name, make("span", name)]));
    row.element = make("li", "", make("span", "dot"), ...TEXTS.map((name) => row[name]));
    this.list.append(row.element);
    this.rows.push(row);
  }
}

function fill(row, receiver) {
  const { problem, lacks } = receiver;
  setData(row.element, "health", problem === null ? "good" : "lost");
  setText(row.address, receiver.address);
  setText(row.word, problem === null ? "OK" : "FAILED");
  setText(row.title, receiver.title);
  setText(row.rate, ratesText(receiver));
  write(row.problem, problem ?? "");
  write(row.bad, badText(receiver));
  write(row.lacks, lacks === "" ? "" : `Lacks: ${lacks}`);
}

function write(element, text) {
  show(element, text !== "");
  setText(element, text);
}

function ratesText({ messages_per_s, reports_per_s, aircraft }) {
  const rate = (value) => (value === null ? "–" : value.toFixed(1));
  return `${rate(messages_per_s)} messages/s, ${rate(reports_per_s)} reports/s, ${aircraft ?? "–"} aircraft`;
}

function badText({ bad, dropped }) {
  const parts = [];
  if (bad > 0) parts.push(`${bad} not understood`);
  if (dropped > 0) parts.push(`${dropped} dropped`);
  return parts.join(", ");
}
