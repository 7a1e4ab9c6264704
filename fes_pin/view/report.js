"use strict";
// Zoom: a figure opens alone; the wheel and + - magnify, dragging moves, a double click goes back. Without this script
// everything on the page reads as well. Folded parts open for printing.
(() => {
  const dialog = document.createElement("dialog");
  dialog.className = "zoom";
  const close = document.createElement("button");
  close.textContent = "close";
  close.addEventListener("click", () => dialog.close());
  const place = document.createElement("div");
  dialog.append(close, place);
  document.body.append(dialog);
  let box = null, whole = null, drawing = null, from = null;
  const show = () => drawing.setAttribute("viewBox", box.join(" "));
  const at = (event) => {
    const r = drawing.getBoundingClientRect();
    return [(event.clientX - r.left) / r.width, (event.clientY - r.top) / r.height];
  };
  const magnify = (factor, u, v) => {
    const f = Math.min(factor, whole[2] / box[2]);
    box = [box[0] + u * box[2] * (1 - f), box[1] + v * box[3] * (1 - f), box[2] * f, box[3] * f];
    show();
  };
  const open = (svg) => {
    drawing = svg.cloneNode(true);
    whole = svg.getAttribute("viewBox").split(" ").map(Number);
    box = [...whole];
    place.replaceChildren(drawing);
    dialog.showModal();
    drawing.addEventListener("wheel", (e) => { e.preventDefault(); magnify(e.deltaY < 0 ? 0.8 : 1.25, ...at(e)); });
    drawing.addEventListener("dblclick", () => { box = [...whole]; show(); });
    drawing.addEventListener("pointerdown", (e) => { from = at(e); drawing.setPointerCapture(e.pointerId); });
    drawing.addEventListener("pointerup", () => { from = null; });
    drawing.addEventListener("pointermove", (e) => {
      if (!from) return;
      const to = at(e);
      box[0] += (from[0] - to[0]) * box[2];
      box[1] += (from[1] - to[1]) * box[3];
      from = to;
      show();
    });
  };
  dialog.addEventListener("keydown", (e) => {
    if (e.key === "+") magnify(0.8, 0.5, 0.5);
    if (e.key === "-") magnify(1.25, 0.5, 0.5);
  });
  for (const svg of document.querySelectorAll("figure > svg")) {
    const button = document.createElement("button");
    button.className = "enlarge";
    button.textContent = "zoom";
    button.addEventListener("click", () => open(svg));
    svg.parentElement.querySelector("figcaption")?.append(" ", button);
  }
  const folded = () => document.querySelectorAll("details:not([open])");
  let opened = [];
  window.addEventListener("beforeprint", () => { opened = [...folded()]; opened.forEach((d) => { d.open = true; }); });
  window.addEventListener("afterprint", () => opened.forEach((d) => { d.open = false; }));
})();
