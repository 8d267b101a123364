// Changes the role of the companion, after a confirmation with the token.

import { find, setAttribute, setText, show } from "../core/dom.js";

const MEANINGS = {
  off: "No conflict detection. If the companion is flying the aircraft, it gives it back first.",
  advise: "Conflicts are announced, nothing is commanded. If the companion is flying the aircraft, it gives it back first.",
  fly: "In a conflict the companion takes over and flies the aircraft around the traffic.",
};
const KEY = "companion.token";
const PATIENCE_MS = 8000;

function remembered() {
  try {
    return sessionStorage.getItem(KEY) ?? "";
  } catch {
    return "";
  }
}

function remember(token) {
  try {
    sessionStorage.setItem(KEY, token);
  } catch {
    return; // then the user types it again
  }
}

export class RolePanel {
  constructor() {
    this.dialog = find("role-dialog");
    this.wanted = null;
    for (const button of this.buttons) button.addEventListener("click", () => this.confirm(button.dataset.role));
    find("role-cancel").addEventListener("click", () => this.dialog.close());
    find("role-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.send();
    });
  }

  get buttons() {
    return [...find("roles").querySelectorAll("button")];
  }

  offer(mayCommand) {
    show(find("roles"), mayCommand);
  }

  update(role) {
    for (const button of this.buttons) {
      setAttribute(button, "aria-pressed", button.dataset.role === role);
    }
  }

  /** Opens the dialog that asks for the token. */
  confirm(role) {
    this.wanted = role;
    setText(find("role-title"), `Change the role to ${role.toUpperCase()}?`);
    setText(find("role-meaning"), MEANINGS[role]);
    setText(find("role-confirm"), `Change to ${role.toUpperCase()}`);
    find("token").value = remembered();
    this.fail("");
    this.dialog.showModal();
    find(find("token").value === "" ? "token" : "role-cancel").focus();
  }

  fail(words) {
    setText(find("role-error"), words);
    show(find("role-error"), words !== "");
  }

  async send() {
    const token = find("token").value.trim();
    find("role-confirm").disabled = true;
    try {
      const problem = await post(this.wanted, token);
      if (problem !== null) return this.fail(problem);
      remember(token);
      this.dialog.close();
    } finally {
      find("role-confirm").disabled = false;
    }
    return undefined;
  }
}

/** Asks the server for a role; returns the problem in words, or null when the role has changed. */
async function post(role, token) {
  try {
    const answer = await fetch("api/role", {
      method: "POST",
      headers: { Authorization: `Bearer ${token}`, "Content-Type": "application/json" },
      body: JSON.stringify({ role }),
      signal: AbortSignal.timeout(PATIENCE_MS),
    });
    if (answer.ok) return null;
    const { error } = await answer.json().catch(() => ({}));
    return typeof error === "string" ? error : `Refused (${answer.status})`;
  } catch {
    return "No answer from the companion, or the token has characters that cannot be sent";
  }
}
