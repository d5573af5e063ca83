// Talks to the server: the cookie that lets the page in, what it asks for and what it changes.

export async function enter() {
  const token = location.hash.slice(1);
  if (!token) return;
  await change("session", { token });
  // The address in the browser's history holds no secret any more.
  history.replaceState(null, "", location.pathname);
}

async function answered(answer) {
  const said = await answer.json().catch(() => ({}));
  if (!answer.ok) throw Object.assign(new Error(said.error || `the server answers ${answer.status}`), { status: answer.status });
  return said;
}

export async function ask(path, query = {}) {
  const words = new URLSearchParams(Object.entries(query).filter(([, v]) => v !== null && v !== undefined));
  return answered(await fetch(`/api/${path}?${words}`));
}

export async function change(path, said = {}) {
  const body = JSON.stringify(said);
  return answered(await fetch(`/api/${path}`, { method: "POST", headers: { "content-type": "application/json" }, body }));
}

export async function picture(index, { low, high, width }) {
  const words = new URLSearchParams(Object.entries({ low, high, width }).filter(([, v]) => v !== null && v !== undefined));
  const answer = await fetch(`/api/frame/${index}?${words}`);
  if (!answer.ok) await answered(answer);
  return createImageBitmap(await answer.blob());
}

export function leave() {
  fetch("/api/leave", { method: "POST", keepalive: true, headers: { "content-type": "application/json" }, body: "{}" });
}
