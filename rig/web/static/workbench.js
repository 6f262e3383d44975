// What each page does in the browser by itself.

// A double click on a button is one click: the second would act on the button that appears in the place of the first.
window.addEventListener("click", (event) => {
  if (event.detail < 2 || !event.target.closest?.("button")) return;
  event.stopImmediatePropagation();
  event.preventDefault();
}, true);

// If the server does not answer, clicks and keys do nothing, and text in fields outlasts the reload.
// Without this, the browser would send a click when the connection is back: a run would begin when nobody expects it.
// A stop is sent when the connection is back, because a late stop is better than none.
// Text of an open dialog is written when a person opens the dialog again: no script presses a button.
(() => {
  const KEPT = "typed text";
  const PATIENCE_MS = 60000; // until a field appears, of a page that computes before it shows all fields
  const LOOK_MS = 200;
  const typed = new Set(); // names of fields in which a person has written
  let waiting = new Map(); // by field, the text that is not written yet

  const lost = () => document.getElementById("popup")?.ariaHidden === "false";
  const isText = (field) =>
    field.matches?.("textarea, input:not([type=checkbox], [type=radio], [type=file])") && !field.closest(".q-select");
  const fields = () => [...document.querySelectorAll("textarea, input")].filter(isText);
  const dialog = (field) => field.closest(".q-dialog")?.ariaLabel ?? "";
  const label = (field) => JSON.stringify([dialog(field), field.getAttribute("aria-label") || field.placeholder]);
  const dialogOf = (name) => JSON.parse(name)[0];
  const named = (name) => fields().find((field) => label(field) === name);

  const stops = (event) => event.key === "F8" || event.target.closest?.(".stops");
  const hold = (event) => {
    const writes = event.type === "keydown" && isText(event.target) && event.key !== "Enter";
    if (!lost() || writes || stops(event)) return;
    event.stopImmediatePropagation();
    event.preventDefault();
  };
  for (const kind of ["click", "keydown"]) window.addEventListener(kind, hold, true);

  window.addEventListener("input", (event) => isText(event.target) && typed.add(label(event.target)), true);
  window.addEventListener("pagehide", () => {
    if (!lost()) return;
    const texts = [...typed].map((name) => [name, named(name)?.value]).filter(([, text]) => text);
    sessionStorage.setItem(KEPT, JSON.stringify({ address: location.href, texts: [...waiting, ...texts] }));
  });

  const kept = JSON.parse(sessionStorage.getItem(KEPT) || "{}");
  sessionStorage.removeItem(KEPT);
  if (kept.address !== location.href) return;
  waiting = new Map(kept.texts);
  const write = (field, text) => {
    Object.getOwnPropertyDescriptor(Object.getPrototypeOf(field), "value").set.call(field, text);
    field.dispatchEvent(new Event("input", { bubbles: true }));
  };
  const note = document.createElement("div");
  note.className = "box note kept";
  note.setAttribute("role", "status");
  const tell = () => {
    const titles = [...new Set([...waiting.keys()].map(dialogOf).filter(Boolean))];
    note.textContent = `The connection was lost. Open "${titles.join('", "')}" again: your text is kept.`;
    titles.length ? document.body.append(note) : note.remove();
  };
  const timer = setInterval(() => {
    if (!window.did_handshake) return;
    for (const [name, text] of waiting) {
      const field = named(name);
      if (!field) continue;
      waiting.delete(name);
      if (field.value !== text) write(field, text);
    }
    tell();
    if (!waiting.size) clearInterval(timer);
  }, LOOK_MS);
  setTimeout(() => waiting.forEach((_, name) => dialogOf(name) || waiting.delete(name)), PATIENCE_MS);
})();
