// The panel at the left: one step at a time.
import { ask } from "./api.js";
import { make } from "./dom.js";
import { nodes as drawNodes, View } from "./draw.js";
import { checkPanel, } from "./check.js";

const STEPS = [["film", "Film"], ["markers", "Markers"], ["links", "Links"], ["check", "Check"]];
const THUMBS = 12;

function field(text, given, change) {
  const input = make("input", { ...given, onchange: () => change(input.value.trim()) });
  return make("label", {}, `${text} `, input);
}

export const steps = {
  build(app) {
    document.getElementById("steps").replaceChildren(...STEPS.map(([id, text], k) =>
      make("li", {}, make("button", { type: "button", id: `step-${id}`, title: `Alt+${k + 1}`, onclick: () => app.enter(id) }, text))));
  },

  ids: STEPS.map(([id]) => id),

  // Draws the panel anew; who types into it is not interrupted.
  show(app, forced = false) {
    const panel = document.getElementById("panel"), active = document.activeElement;
    for (const [id] of STEPS) {
      const button = document.getElementById(`step-${id}`);
      if (id === app.step) button.setAttribute("aria-current", "step"); else button.removeAttribute("aria-current");
    }
    if (!app.state || !forced && panel.contains(active) && active.matches("input, select")) return;
    const kept = panel.contains(active) ? active.id : null;
    panel.setAttribute("aria-label", STEPS.find(([id]) => id === app.step)[1]);
    panel.replaceChildren(...PANELS[app.step](app));
    if (kept) document.getElementById(kept)?.focus();
    if (app.step === "markers") thumbs(app);
  },

  frameChanged(app) {
    const here = document.getElementById("here");
    if (here) here.textContent = `frame ${app.frame}`;
  },
};

const PANELS = { film: filmPanel, markers: markersPanel, links: linksPanel, check: checkPanel };

function filmPanel(app) {
  const { film, choice, files, command } = app.state, rate = choice.fps ?? film.rate_hz;
  const facts = [
    ["container", `${film.container}, ${film.codec}`], ["size", `${film.width} x ${film.height} px, ${film.depth_bits} bit`],
    ["frames", String(film.frames ?? "not known")], ["frames a second", rate ? `${+rate.toPrecision(8)} (${choice.fps ? "you" : film.rate_origin.replaceAll("_", " ")})` : "not known"],
  ];
  const consequence = make("p", { class: "quiet", id: "consequence" });
  const fps = field("Frames a second, as filmed", { type: "number", id: "fps", min: "0", step: "any", value: choice.fps ?? "" }, (v) => app.choose({ fps: v === "" ? null : Number(v) }));
  fps.querySelector("input").addEventListener("input", (e) => {
    const ratio = Number(e.target.value) / (film.rate_hz || NaN);
    consequence.textContent = ratio > 0 && Math.abs(ratio - 1) > 1e-6
      ? `With the film's own ${+film.rate_hz.toPrecision(6)} speeds would come out ${+(1 / ratio).toPrecision(3)} times, and g ${+(1 / ratio ** 2).toPrecision(3)} times what they are.` : "";
  });
  const top = 2 ** film.depth_bits - 1, levels = app.film.levels;
  const level = (id, text, value) => {
    const input = make("input", { type: "range", id, min: 0, max: top, step: Math.max(1, top / 255), value, oninput: () => stretch() });
    return make("label", {}, text, " ", input);
  };
  const stretch = () => {
    const [low, high] = ["low", "high"].map((id) => Number(document.getElementById(id).value));
    app.film.setLevels(low === 0 && high === top ? null : low, low === 0 && high === top ? null : Math.max(high, low + 1));
    app.go(app.frame);
  };
  return [
    make("table", {}, make("tbody", {}, ...facts.map(([k, v]) => make("tr", {}, make("th", { scope: "row" }, k), make("td", {}, v))))),
    ...film.notes.map((n) => make("p", { class: "quiet" }, n)),
    fps, consequence,
    field("Frames to follow, A..B", { type: "text", id: "frames", placeholder: `0..${film.frames ?? ""}`, value: choice.frames ?? "" }, (v) => app.choose({ frames: v || null })),
    make("fieldset", {}, make("legend", {}, "Part of the picture"),
      field("X0,Y0,X1,Y1", { type: "text", id: "region", placeholder: "all of it", value: choice.region ?? "" }, (v) => app.choose({ region: v || null })),
      make("div", { class: "row-of" },
        make("button", { type: "button", id: "draw-box", onclick: () => { app.boxing = {}; document.getElementById("film").focus(); } }, "Draw a box"),
        make("button", { type: "button", id: "no-box", onclick: () => app.choose({ region: null }) }, "All of it"))),
    make("fieldset", {}, make("legend", {}, "Shown brightness (changes nothing else)"),
      level("low", "black at", levels.low ?? 0), level("high", "white at", levels.high ?? top)),
    make("h2", {}, "Files"),
    make("p", { class: "quiet" }, `Decisions: ${files.edits}`), make("p", { class: "quiet" }, `Table: ${files.table}`),
    make("p", { class: "quiet" }, "The same at the command line:"), make("code", { id: "command" }, command),
    keysTable(),
  ];
}

function markersPanel(app) {
  const { choice, work, film } = app.state, table = app.table;
  const top = 2 ** film.depth_bits - 1;
  const found = table ? `${table.nodes.length} found${choice.markers ? ` of ${choice.markers}` : ""}` : work.busy ? "looking" : "none followed";
  const seeds = choice.marker.map(([x, y, f], k) => make("li", {},
    make("button", { type: "button", onclick: () => app.go(f) }, `${x}, ${y} in frame ${f}`),
    make("button", { type: "button", "aria-label": `Take marker ${k + 1} out`, onclick: () => app.choose({ marker: choice.marker.filter((_, i) => i !== k) }) }, "Take out")));
  const candidates = work.candidates.map((c) => make("li", {},
    make("span", {}, `${c.number}: ${c.words}`),
    make("button", { type: "button", id: `follow-${c.number}`, onclick: async () => { await app.choose({ marker: [...choice.marker, [c.x, c.y, c.frame]] }); app.go(c.frame); } }, "Follow this")));
  return [
    make("p", {}, make("strong", {}, found), ". Click a marker in the film to have it followed; click each one that you want."),
    ...(seeds.length ? [make("h2", {}, "Followed because you pointed at it"), make("ul", { class: "list", id: "seeds" }, ...seeds)] : []),
    ...(candidates.length ? [make("h2", {}, "What could be meant"), make("ul", { class: "list", id: "candidates" }, ...candidates)] : []),
    make("h2", { id: "thumbs-title" }, "Twelve frames of the film"),
    make("div", { class: "thumbs", id: "thumbs", role: "group", "aria-labelledby": "thumbs-title" }),
    field("How many markers", { type: "number", id: "markers", min: 1, value: choice.markers ?? "" }, (v) => app.choose({ markers: v === "" ? null : Number(v) })),
    polarity(app),
    make("fieldset", {}, make("legend", {}, "Threshold"),
      make("label", {}, make("input", { type: "checkbox", id: "looks", checked: app.looks, onchange: (e) => { app.looks = e.target.checked; app.look(); } }), " show what stands out (T)"),
      make("label", {}, "level ", make("input", {
        type: "range", id: "threshold", min: 0, max: top, step: Math.max(1, top / 255), value: app.threshold ?? choice.threshold ?? top / 2,
        oninput: (e) => { app.threshold = Number(e.target.value); app.looks = true; document.getElementById("looks").checked = true; app.look(); count(app); },
      })),
      make("p", { class: "quiet", id: "count" }),
      make("div", { class: "row-of" },
        make("button", { type: "button", id: "use-threshold", onclick: () => app.choose({ threshold: app.threshold ?? top / 2 }) }, "Use this level"),
        make("button", { type: "button", id: "no-threshold", onclick: () => { app.threshold = null; app.choose({ threshold: null }); } }, "Learn it from the film"))),
    ...work.warnings.map((w) => make("p", { class: "quiet" }, w)),
  ];
}

async function count(app) {
  const said = await ask(`detections/${app.frame}`, { threshold: app.threshold }).catch((e) => ({ all: 0, problem: e.message }));
  const at = document.getElementById("count");
  if (at) at.textContent = said.problem ?? `${said.all} stand out in frame ${app.frame} at ${Math.round(app.threshold)}`;
}

function polarity(app) {
  const words = [["auto", "found in the film"], ["bright", "brighter"], ["dark", "darker"]];
  const select = make("select", { id: "polarity", onchange: () => app.choose({ polarity: select.value }) },
    ...words.map(([v, text]) => make("option", { value: v, selected: app.state.choice.polarity === v }, text)));
  return make("label", {}, "Brighter or darker than what is around ", select);
}

// Twelve frames spread over the film with what is followed: a choice that fails later is seen now.
async function thumbs(app) {
  const place = document.getElementById("thumbs"), { film } = app.state;
  const count = Math.min(THUMBS, app.last - app.first + 1), version = app.version;
  const frames = [...Array(count).keys()].map((k) => Math.round(app.first + k * (app.last - app.first) / Math.max(1, count - 1)));
  place.replaceChildren(...frames.map((f) => make("button", { type: "button", onclick: () => app.go(f) }, make("canvas", { width: 240, height: Math.round(240 * film.height / film.width), "aria-hidden": "true" }), `frame ${f}`)));
  for (const [k, f] of frames.entries()) {
    const [picture, row] = await Promise.all([app.film.picture(f, 240), app.film.row(f)]).catch(() => [null, null]);
    if (version !== app.version || !place.isConnected || !picture) return;
    const canvas = place.children[k].querySelector("canvas"), context = canvas.getContext("2d"), view = new View(canvas);
    Object.assign(view, { scale: 240 / film.width, x: 0, y: 0 });
    context.drawImage(picture, 0, 0, canvas.width, canvas.height);
    drawNodes(context, view, row, app.names, app.bodies, null);
    const seen = row ? row.filter(([x]) => x !== null).length : 0;
    place.children[k].lastChild.textContent = app.table ? `frame ${f}: ${seen} of ${app.names.length}` : `frame ${f}`;
  }
}

function linksPanel(app) {
  const table = app.table;
  if (!table) return [make("p", {}, "Find the markers first.")];
  const rows = table.nodes.map((n, k) => {
    const name = make("input", { type: "text", id: `name-${k}`, value: n.name, "aria-label": `Name of ${n.name}` });
    const body = make("input", { type: "text", id: `body-${k}`, value: n.body, list: "bodies", "aria-label": `Link of ${n.name}` });
    return { old: n.name, name, body, row: make("tr", {}, make("td", {}, name), make("td", {}, body)) };
  });
  const used = app.state.edits.length > 0;
  return [
    make("p", {}, "Markers of one link keep their distances. Give two markers the same link by its name."),
    make("datalist", { id: "bodies" }, ...table.bodies.map((b) => make("option", { value: b }))),
    make("table", {}, make("thead", {}, make("tr", {}, make("th", { scope: "col" }, "marker"), make("th", { scope: "col" }, "link"))), make("tbody", {}, ...rows.map((r) => r.row))),
    make("div", { class: "row-of" }, make("button", {
      type: "button", class: "main", id: "arrange",
      onclick: () => app.arrange({ nodes: rows.map((r) => [r.old, r.name.value.trim(), r.body.value.trim()]) }),
    }, "Track with these")),
    used ? make("p", { class: "quiet" }, "Decisions of step Check call markers by their names: change names before you decide.") : null,
    table.joints.length ? make("p", { class: "quiet" }, `Joints: ${table.joints.map((j) => `${j.name} (${j.bodies.join(", ")})`).join("; ")}`) : null,
  ].filter((e) => e !== null);
}

const KEYS = [
  ["← →", "frame before, next; with Shift ten"], ["Space", "play, stop"], ["+ − 0", "zoom, whole picture"],
  ["Alt+1 … Alt+4", "steps"], ["T", "show what stands out"],
  ["I J K L, Enter", "move the cross-hair and point, instead of a click (Shift: 10 px)"],
  ["N, B", "next doubt, doubt before"], ["1 … 9", "the numbered spot is the chosen marker"], ["X", "no marker"], ["Z", "undo"], ["M", "next marker"],
];

function keysTable() {
  return make("details", {}, make("summary", {}, "Keys"), make("table", {}, make("tbody", {},
    ...KEYS.map(([k, v]) => make("tr", {}, make("th", { scope: "row" }, make("kbd", {}, k)), make("td", {}, v))))));
}

