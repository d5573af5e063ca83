// The gap map, the doubts, and the decisions on them.
import { ask } from "./api.js";
import { STATES, css } from "./draw.js";
import { make } from "./dom.js";

// Rows of markers, time across: a click takes the film there.
export function gapMap(app, place) {
  const table = app.table;
  if (!table) { place.replaceChildren(); return; }
  const key = JSON.stringify([table.runs, app.node, place.clientWidth, css("--seen")]);
  if (place.dataset.key === key) return;
  place.dataset.key = key;
  const kept = place.contains(document.activeElement) ? document.activeElement.textContent : null;
  place.replaceChildren(...table.nodes.map((n, k) => {
    const canvas = make("canvas", { "aria-hidden": "true", title: "Click: go there" });
    canvas.addEventListener("click", (e) => {
      const box = canvas.getBoundingClientRect();
      app.chooseNode(n.name);
      app.go(table.first + Math.floor((e.clientX - box.left) / box.width * table.frames));
    });
    const seen = `${(100 * table.seen[k]).toFixed(1)} %`;
    const button = make("button", { type: "button", "aria-pressed": String(app.node === n.name), title: `${n.name}: known in ${seen} of the frames`, onclick: () => app.chooseNode(n.name) }, `${n.name} ${seen}`);
    requestAnimationFrame(() => stripe(canvas, table, table.runs[k]));
    return make("div", { class: "row" }, button, canvas);
  }));
  const known = STATES.filter((_, k) => table.runs.some((runs) => runs.some(([state]) => state === k)));
  place.append(make("p", { class: "legend" }, ...known.map((s) => make("span", { class: `is-${s}` }, WORDS[s]))));
  if (kept) [...place.querySelectorAll("button")].find((b) => b.textContent === kept)?.focus();
}

const WORDS = { missing: "not seen", seen: "seen", reacquired: "back", ambiguous: "another name is possible", undecoded: "not decoded", manual: "by a person" };

function stripe(canvas, table, runs) {
  const ratio = devicePixelRatio || 1, width = Math.max(1, Math.round(canvas.clientWidth * ratio)), height = Math.round(20 * ratio);
  Object.assign(canvas, { width, height });
  const context = canvas.getContext("2d"), per = width / (table.last - table.first + 1);
  // What is known first, doubts above it, so that one frame of a hundred thousand is seen.
  for (const wanted of [[1, 2], [5], [0], [4], [3]]) {
    for (const [state, first, last] of runs) {
      if (!wanted.includes(state)) continue;
      context.fillStyle = css(`--${STATES[state]}`);
      context.fillRect((first - table.first) * per, 2 * ratio, Math.max(ratio, (last - first + 1) * per), height - 4 * ratio);
    }
  }
}

export function currentDoubt(app) {
  return app.table?.doubts.find((d) => d.node === app.node && d.first <= app.frame && app.frame <= d.last) ?? null;
}

// Goes to the next doubt after this frame, or the one before it; around at the end.
export async function nextDoubt(app, way = 1) {
  const all = app.table?.doubts ?? [];
  if (!all.length) { app.enter("check"); return; }
  const here = currentDoubt(app), at = here ? all.indexOf(here) : -1;
  let next;
  if (at >= 0) next = all[(at + way + all.length) % all.length];
  else if (way > 0) next = all.find((d) => d.first > app.frame) ?? all[0];
  else next = all.findLast((d) => d.first < app.frame) ?? all[all.length - 1];
  app.node = next.node;
  app.frame = next.first;
  app.enter("check");
  gapMap(app, document.getElementById("map"));
}

function span(app) {
  const doubt = currentDoubt(app);
  if (app.spread === "frame" || !doubt) return [app.frame, app.frame + 1];
  return [doubt.first, doubt.last + 1];
}

// The numbered spot is the chosen marker, in the frames of the doubt as far as it is followed.
export async function assign(app, number) {
  const spot = app.detections?.found[number - 1];
  if (!spot || app.node === null || app.shown !== app.frame) return;
  const [x, y, sigma] = spot, [a, b] = span(app);
  const node = app.node, frame = app.frame;
  if (app.table.moving || app.spread === "frame") await app.decide({ what: "place", node, frame, at_px: [x, y], sigma_px: Math.max(sigma, 0.001) });
  else await app.decide({ what: "name", node, frame, at_px: [x, y], frames: `${a}..${b}` });
}

export async function nothing(app) {
  const [a, b] = span(app);
  if (app.node !== null) await app.decide({ what: "no_marker", node: app.node, frames: `${a}..${b}` });
}

export function checkPanel(app) {
  const { table, state } = app;
  if (!table) return [make("p", {}, "Find the markers first.")];
  const doubt = currentDoubt(app), all = table.doubts, moreDoubts = all.filter((d) => d.first !== doubt?.first || d.node !== doubt?.node);
  const select = make("select", { id: "node", onchange: () => { const v = select.value; select.blur(); app.chooseNode(v); } }, ...app.names.map((n) => make("option", { value: n, selected: n === app.node }, n)));
  const other = make("select", { id: "other" }, ...app.names.filter((n) => n !== app.node).map((n) => make("option", { value: n }, n)));
  const spread = (value, text) => make("label", {}, make("input", { type: "radio", name: "spread", id: `spread-${value}`, value, checked: app.spread === value, onchange: () => { app.spread = value; } }), ` ${text}`);
  return [
    make("p", {}, make("strong", { id: "doubts" }, all.length === 0 ? "No doubt is left." : `${all.length} doubt${all.length > 1 ? "s" : ""}`), all.length ? " to look at." : ""),
    make("p", { id: "doubt" }, doubt ? `${doubt.node}, frames ${doubt.first} to ${doubt.last}: ${doubt.why}.` : ""),
    make("div", { class: "row-of" },
      make("button", { type: "button", class: "main", id: "next", disabled: all.length === 0, onclick: () => nextDoubt(app) }, "Next doubt (N)"),
      make("button", { type: "button", id: "undo", disabled: state.edits.length === 0, onclick: () => app.undo() }, "Undo (Z)")),
    make("label", {}, "Marker ", select),
    make("p", { class: "quiet" }, "In the film: keys 1 to 9 say which numbered spot it is; a click or a drag places it by hand; the cross is where it should be by the frames around."),
    make("div", { class: "row-of" }, make("button", { type: "button", id: "none", onclick: () => nothing(app) }, "No marker here (X)")),
    make("fieldset", {}, make("legend", {}, "Numbers and X are for"), spread("doubt", "the doubt’s frames"), spread("frame", "this frame only")),
    make("label", {}, "Standard uncertainty of a place by hand, px ", make("input", { type: "number", id: "sigma", min: 0.05, step: "any", value: app.sigma, onchange: (e) => { const v = Number(e.target.value); if (v > 0) app.sigma = v; } })),
    app.names.length > 1 ? make("fieldset", {}, make("legend", {}, "Names exchanged"),
      make("label", {}, `${app.node} and `, other, " from this frame on"),
      make("button", { type: "button", id: "exchange", onclick: () => app.decide({ what: "exchange", node: app.node, with: other.value, frames: `${app.frame}..` }) }, "Exchange")) : null,
    make("h2", {}, "Decisions"),
    table.decided ? make("p", { id: "decided" }, table.decided) : null,
    make("ul", { class: "list", id: "edits" }, ...state.edits.slice(-8).reverse().map((e) => make("li", {}, make("span", {}, said(e)), make("button", { type: "button", onclick: () => { app.chooseNode(e.node); app.go(e.frame ?? Number(e.frames.split("..")[0])); } }, "Show")))),
    ...(moreDoubts.length ? [make("h2", {}, "Doubts"), make("ul", { class: "list", id: "list" }, ...all.slice(0, 40).map((d) => make("li", {}, make("span", {}, `${d.node}, ${d.first}–${d.last}: ${d.why}`), make("button", { type: "button", "aria-label": `Show ${d.node} in frame ${d.first}`, onclick: () => { app.chooseNode(d.node); app.go(d.first); } }, "Show"))))] : []),
    curve(app),
  ].filter((e) => e !== null);
}

function said(e) {
  const frames = e.frame !== undefined ? `frame ${e.frame}` : `frames ${e.frames}`;
  const what = { place: "placed", no_marker: "no marker", name: "named", exchange: `exchanged with ${e.with}` }[e.what] ?? e.what;
  return `${e.node} ${what}, ${frames}, by ${e.by}`;
}

// The chosen marker's places over the frames; a click goes there.
function curve(app) {
  const place = make("div", { class: "curve", id: "curve" });
  const version = app.version, node = app.node;
  if (node === null) return place;
  ask("curve", { node }).then((data) => {
    if (!place.isConnected || version !== app.version || node !== app.node) return;
    const ink = css("--ink"), grid = { stroke: css("--line"), width: 1 }, axis = { stroke: ink, grid, ticks: grid, size: 44 };
    const plot = new uPlot({
      width: Math.max(200, place.clientWidth), height: 170, title: `${node}: x and y, px`, legend: { show: false },
      scales: { x: { time: false } }, axes: [axis, axis],
      series: [{}, { stroke: css("--reacquired"), width: 1.5 }, { stroke: css("--ambiguous"), width: 1.5 }],
    }, [data.frame, data.x, data.y], place);
    plot.over.addEventListener("click", () => { if (plot.cursor.idx !== null) app.go(data.frame[plot.cursor.idx]); });
  }).catch(() => {});
  return place;
}
