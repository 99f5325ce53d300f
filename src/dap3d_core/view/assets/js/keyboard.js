// Keys, and the list of them that "?" shows.

function listen(app) {
  const { transport, panel } = app;
  const fixed = [
    [[" "], "Space", "play, pause", () => transport.toggle()],
    [["ArrowLeft"], "\u2190", "one instant back (ten with shift)", (shift) => transport.step(shift ? -10 : -1)],
    [["ArrowRight"], "\u2192", "one instant on (ten with shift)", (shift) => transport.step(shift ? 10 : 1)],
    [["Home"], "Home", "to the start", () => transport.seek(app.motion.start)],
    [["End"], "End", "to the end", () => transport.seek(app.motion.end)],
    [["+", "="], "+", "faster", () => transport.faster(1)],
    [["-", "_"], "-", "slower", () => transport.faster(-1)],
    [["l"], "L", "repeat at the end, or stop", () => transport.setLoop(!transport.loop)],
    [["f"], "F", "follow the next body; none after the last", () => app.followNext()],
    [["r"], "R", "frame the whole motion", () => app.fit()],
    [["d"], "D", "light or dark", () => app.flipTheme()],
    [["?"], "?", "this list", () => element("help").showModal()],
  ];
  const switches = Object.entries(panel.switches).filter(([, s]) => s.key)
    .map(([name, s]) => [[s.key.toLowerCase()], s.key, `${name} on, off`, s.flip]);
  const every = [...fixed, ...switches];
  element("keys").append(...every.flatMap(([, shown, words]) => [make("dt", "", {}, make("kbd", shown)), make("dd", words)]));
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || element("help").open) return;
    const { target } = event, typing = target.id === "time" || target.tagName === "SELECT" || isPointSlider(target, event.key);
    if (typing && event.key !== "Escape") return;
    if (event.key === " " && target.tagName === "BUTTON") return; // a button has the space bar itself
    const found = every.find(([keys]) => keys.includes(event.key.length === 1 ? event.key.toLowerCase() : event.key));
    if (found) {
      event.preventDefault();
      found[3](event.shiftKey);
    }
  });
}
