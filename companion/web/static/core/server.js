// What the page asks of its server. Of several aircraft, the page's own address names the one that it shows.

export const member = new URLSearchParams(location.search).get("member");

/** The address of a part of the server, for the aircraft shown. */
export function addressOf(path) {
  return member === null ? path : `${path}?member=${encodeURIComponent(member)}`;
}

/** The answer as JSON; null when there is none, as it is asked for again. */
export async function getJson(path) {
  try {
    const answer = await fetch(addressOf(path), { cache: "no-store" });
    return answer.ok ? await answer.json() : null;
  } catch {
    return null;
  }
}
