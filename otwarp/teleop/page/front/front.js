// What otwarp adds to viser's page. Nothing here talks to the server: it shows what the panel says, and names things.
(() => {
  "use strict";
  const said = JSON.parse(document.getElementById("otwarp-front").textContent);
  const HINT_FOR = 9000; // milliseconds for which the hint about the mouse stays
  const FOLD = { left: 1000, right: 560 }; // width of the window below which a panel is folded [pixels]

  const make = (tag, properties = {}, ...children) => {
    const element = Object.assign(document.createElement(tag), properties);
    element.append(...children);
    return element;
  };

  const canvas = () => document.querySelector("canvas[data-engine]");

  function hasWebGL() {
    try {
      return Boolean(document.createElement("canvas").getContext("webgl2"));
    } catch {
      return false;
    }
  }

  function sayTrouble() {
    const words = make("div", { role: "alert" });
    words.innerHTML =
      "<h1>This browser cannot draw the scene</h1>" +
      "<p>The picture needs WebGL 2, which is switched off or missing here. Nothing is wrong with the scene or the run.</p>" +
      "<p>What helps, most often first: switch on hardware acceleration in the browser's settings and start it again; " +
      "use a current Firefox, Chrome, Edge or Safari; over a remote desktop, open the page in a browser of your own " +
      "machine through a tunnel (<code>ssh -L 8080:localhost:8080 lab</code>).</p>" +
      "<p>Without any of this, <code>otwarp preview</code> draws scenes and recorded runs as pictures and movies.</p>";
    document.body.append(make("div", { id: "otwarp-trouble" }, words));
  }

  function table(rows) {
    const body = make("tbody");
    for (const [key, what] of rows) {
      body.append(make("tr", {}, make("td", {}, make("kbd", { textContent: key })), make("td", { textContent: what })));
    }
    return make("table", {}, body);
  }

  let help = null;

  function toggleHelp() {
    if (help !== null) {
      help.remove();
      help = null;
      button.setAttribute("aria-expanded", "false");
      button.focus();
      return;
    }
    help = make("div", { id: "otwarp-help", role: "dialog", tabIndex: -1 });
    help.setAttribute("aria-label", "Help: mouse and keys");
    help.append(make("h2", { textContent: "In the picture" }), table(said.drags));
    if (said.keys.length) help.append(make("h2", { textContent: "Keys" }), table(said.keys));
    help.append(make("button", { textContent: "Close", onclick: toggleHelp }));
    document.body.append(help);
    button.setAttribute("aria-expanded", "true");
    help.focus();
  }

  const button = make("button", { id: "otwarp-help-button", textContent: "?", onclick: toggleHelp });
  button.setAttribute("aria-label", "Help: mouse and keys");
  button.setAttribute("aria-expanded", "false");

  const typing = (element) => element instanceof HTMLElement && element.matches("input, textarea, select");

  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && help !== null) toggleHelp();
    else if (event.key === "?" && !typing(event.target)) toggleHelp();
  });

  // viser turns the camera by the arrow keys, found by their code; its commands are found by their key
  document.addEventListener(
    "keydown",
    (event) => {
      if (!said.arrows || !event.isTrusted || !event.key.startsWith("Arrow") || typing(event.target)) return;
      if (event.target instanceof HTMLElement && event.target.matches("[role=slider], [role=tab]")) return;
      event.stopImmediatePropagation();
      event.preventDefault();
      const { key, shiftKey, ctrlKey, altKey, metaKey } = event;
      event.target.dispatchEvent(
        new KeyboardEvent("keydown", { key, shiftKey, ctrlKey, altKey, metaKey, bubbles: true, cancelable: true }),
      );
    },
    true,
  );

  // a part of a map that the panel shows: its number goes into the field that it names, as if it were typed there
  document.addEventListener("click", (event) => {
    const cell = event.target instanceof Element ? event.target.closest("[data-otwarp-set]") : null;
    if (cell !== null) type(cell.dataset.otwarpField, cell.dataset.otwarpSet);
  });

  /** Put text into the field of that name, as if it were typed there. */
  function type(name, text) {
    for (const field of document.querySelectorAll("#root input")) {
      if ((field.labels?.[0]?.textContent ?? field.getAttribute("aria-label")) !== name) continue;
      Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set.call(field, text);
      field.dispatchEvent(new Event("input", { bubbles: true }));
    }
  }

  // a plot of a recording takes the cursor to where it is clicked on, or dragged over
  function seek(event) {
    const plot = event.target instanceof Element ? event.target.closest(".u-over") : null;
    const cursor = document.querySelector('[data-otwarp="cursor"]');
    if (plot === null || cursor === null || event.buttons !== 1) return;
    const { left, width } = plot.getBoundingClientRect();
    const share = Math.min(Math.max((event.clientX - left) / width, 0), 1);
    const [first, last] = [Number(cursor.dataset.first), Number(cursor.dataset.last)];
    type("Time [s]", (first + share * (last - first)).toFixed(6));
  }

  document.addEventListener("pointerdown", seek);
  document.addEventListener("pointermove", seek);

  const beside = make("aside");
  const over = {};

  /** Copy an element of the panel over the picture; returns the copy, or null where there is nothing to show. */
  function copied(name, write) {
    const source = document.querySelector(`[data-otwarp="${name}"]`);
    if (source === null || (name !== "cursor" && source.textContent === "")) {
      over[name]?.remove();
      delete over[name];
      return null;
    }
    if (over[name] === undefined) {
      over[name] = make("div", { id: `otwarp-${name}`, className: "otwarp-over" });
      beside.append(over[name]);
    }
    const key = source.outerHTML;
    if (over[name].dataset.shown !== key) {
      over[name].dataset.shown = key;
      write(over[name], source);
    }
    return over[name];
  }

  function box(element, html) {
    element.innerHTML = "";
    element.append(make("div", { innerHTML: html }));
  }

  function bar(element, source) {
    box(element, "");
    const line = make("div", { className: "bar" });
    line.style.width = `${source.dataset.pixels}px`;
    element.firstChild.append(make("div", { className: "text", textContent: source.textContent }), line);
    element.dataset.pixels = source.dataset.pixels;
  }

  function cursors() {
    const source = document.querySelector('[data-otwarp="cursor"]');
    if (source === null) return;
    const left = `${100 * Math.min(Math.max(Number(source.dataset.share), 0), 1)}%`;
    for (const plot of document.querySelectorAll(".u-over")) {
      let line = plot.querySelector(".otwarp-cursor");
      if (line === null) {
        line = make("div", { className: "otwarp-cursor" });
        plot.append(line);
      }
      if (line.style.left !== left) line.style.left = left;
    }
  }

  const begun = performance.now();
  let dragged = false;

  function hint() {
    if (dragged || performance.now() - begun > HINT_FOR) {
      over.hint?.remove();
      delete over.hint;
      return null;
    }
    if (over.hint === undefined) {
      over.hint = make("div", { id: "otwarp-hint", className: "otwarp-over" });
      box(over.hint, "");
      over.hint.firstChild.textContent = said.drags.map(([how, what]) => `${how}: ${what}`).join("   ·   ");
      beside.append(over.hint);
    }
    return over.hint;
  }

  function place(element, style) {
    for (const [name, value] of Object.entries(style)) {
      if (element !== null && element.style[name] !== value) element.style[name] = value;
    }
  }

  function turn() {
    cursors();
    const legend = copied("legend", (element, source) => box(element, source.innerHTML));
    const note = copied("note", (element, source) => box(element, source.innerHTML));
    const scale = copied("scale", bar);
    const seen = canvas()?.getBoundingClientRect();
    if (seen !== undefined) {
      const [right, bottom] = [window.innerWidth - seen.right, window.innerHeight - seen.bottom];
      place(legend, { left: `${seen.left + 10}px`, top: `${seen.top + 10}px`, display: seen.width < 360 ? "none" : "" });
      place(note, { right: `${right + 10}px`, top: `${seen.top + 10}px` });
      place(scale, { left: `${seen.left + 14}px`, bottom: `${bottom + 12}px` });
      place(button, { right: `${right + 12}px`, bottom: `${bottom + 12}px` });
      place(hint(), { left: `${seen.left + 14}px`, bottom: `${bottom + 66}px`, maxWidth: `${seen.width - 80}px` });
    }
    requestAnimationFrame(turn);
  }

  const folded = {};

  /** Fold panels where the window becomes so small that they leave no picture, and unfold those where it grows. */
  function fold() {
    for (const [side, width] of Object.entries(FOLD)) {
      const small = window.innerWidth < width;
      // one folds the panels of a side, the other unfolds them
      const handle = document
        .querySelector(`[data-dock-region="${side}"]`)
        ?.querySelector("[data-dock-region-collapse], [data-dock-minimize-all][aria-expanded=false]") ?? null;
      if (handle === null || small === (folded[side] ?? false)) continue;
      folded[side] = small;
      if (small === (handle.getAttribute("aria-expanded") === "true")) handle.click();
    }
  }

  /** Name what viser leaves without a name for those who hear the page: sliders, boxes, icons, the picture. */
  function nameThings() {
    if (document.title !== said.title) document.title = said.title;
    canvas()?.setAttribute("aria-label", `${said.title}: the scene in three dimensions`);
    canvas()?.setAttribute("role", "img");
    for (const field of document.querySelectorAll("[role=slider], input, textarea")) {
      if (field.getAttribute("aria-label") || field.labels?.length) continue;
      let row = field.parentElement;
      while (row !== null && row.id !== "root") {
        const label = row.querySelector("label");
        if (label !== null && label.textContent) {
          field.setAttribute("aria-label", label.textContent);
          break;
        }
        row = row.parentElement;
      }
    }
    for (const plot of document.querySelectorAll(".uplot")) {
      plot.setAttribute("role", "img");
      plot.setAttribute("aria-label", `Plot: ${plot.querySelector(".u-title")?.textContent ?? ""}`);
    }
    for (const part of document.querySelectorAll("[data-scrollarea-viewport]")) part.tabIndex = 0; // scrolled by keys
    for (const icon of document.querySelectorAll("#root button")) {
      if (!icon.textContent.trim() && !icon.getAttribute("aria-label")) {
        icon.setAttribute("aria-label", icon.title || "Panel");
      }
    }
  }

  document.addEventListener("DOMContentLoaded", () => {
    if (!hasWebGL()) {
      sayTrouble();
      return;
    }
    document.body.prepend(make("header", { className: "otwarp-unseen" }, make("h1", { textContent: said.title })));
    document.getElementById("root").setAttribute("role", "main");
    beside.setAttribute("aria-label", "Legend, scale and help");
    beside.append(button);
    document.body.append(beside);
    document.addEventListener("pointerdown", (event) => { dragged ||= event.target === canvas(); }, true);
    setInterval(() => { nameThings(); fold(); }, 500);
    requestAnimationFrame(turn);
  });
})();
