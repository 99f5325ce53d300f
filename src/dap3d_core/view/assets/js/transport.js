// Time: play, pause, seek, step, speed, repeat.

const SPEEDS = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100];

class Transport {
  constructor(motion, changed) {
    Object.assign(this, { changed, t: motion.start, playing: false, loop: true });
    this.slider = element("slider");
    this.#measure(motion);
    this.speed = this.#usual();
    element("speed").append(...SPEEDS.map((s) => make("option", `${s} \u00d7`, { value: s })));
    element("play").addEventListener("click", () => this.toggle());
    element("back").addEventListener("click", () => this.step(-1));
    element("forward").addEventListener("click", () => this.step(1));
    element("loop").addEventListener("click", () => this.setLoop(!this.loop));
    element("speed").addEventListener("change", () => this.setSpeed(Number(element("speed").value)));
    this.slider.addEventListener("input", () => this.seek(Number(this.slider.value)));
    element("time").addEventListener("change", () => this.seek(Number(element("time").value.replace(",", "."))));
    this.setSpeed(this.speed);
    this.#show();
  }

  #measure(motion) {
    this.motion = motion;
    this.slider.min = motion.start;
    this.slider.max = motion.end;
    const step = motion.frames > 1 ? (motion.end - motion.start) / (motion.frames - 1) : 1;
    this.digits = Math.min(9, Math.max(2, Math.ceil(-Math.log10(step || 1)) + 1));
  }

  // Another motion, at the same time as far as it goes.
  exchange(motion) {
    this.#measure(motion);
    this.seek(this.t);
  }

  // The round speed nearest 1 with which the whole takes 1.5 to 40 s.
  #usual() {
    const length = this.motion.end - this.motion.start;
    if (!(length > 0)) return 1;
    const fits = SPEEDS.filter((s) => length / s >= 1.5 && length / s <= 40);
    return (fits.length ? fits : SPEEDS).reduce((a, b) => (Math.abs(Math.log(b)) < Math.abs(Math.log(a)) ? b : a));
  }

  toggle() { if (this.playing) this.pause(); else this.play(); }

  play() {
    if (this.motion.frames < 2) return;
    if (this.t >= this.motion.end) this.t = this.motion.start;
    this.playing = true;
    this.last = undefined;
    this.#show();
    this.changed();
  }

  pause() {
    this.playing = false;
    this.#show();
  }

  seek(t) {
    if (Number.isFinite(t)) this.t = Math.min(Math.max(t, this.motion.start), this.motion.end);
    this.#show();
    this.changed();
  }

  // To the reported instant so many further on; the nearest one in that direction comes first.
  step(count) {
    this.pause();
    const { frame, part } = this.motion.locate(this.t);
    const from = part > 0 && count < 0 ? frame + 1 : frame;
    this.seek(this.motion.t[Math.min(Math.max(from + count, 0), this.motion.frames - 1)]);
  }

  setSpeed(speed) {
    this.speed = speed;
    element("speed").value = String(speed);
  }

  faster(by) {
    this.setSpeed(SPEEDS[Math.min(Math.max(SPEEDS.indexOf(this.speed) + by, 0), SPEEDS.length - 1)]);
  }

  setLoop(loop) {
    this.loop = loop;
    element("loop").setAttribute("aria-pressed", String(loop));
  }

  // Called for every picture; moves time on by what has passed, ms.
  tick(now) {
    if (!this.playing) return;
    const passed = this.last === undefined ? 0 : Math.min(now - this.last, 250) / 1000;
    this.last = now;
    this.t += passed * this.speed;
    if (this.t >= this.motion.end) {
      if (this.loop) this.t = this.motion.start + ((this.t - this.motion.start) % (this.motion.end - this.motion.start));
      else { this.t = this.motion.end; this.pause(); }
    }
    this.#show();
  }

  #show() {
    this.slider.value = this.t;
    if (document.activeElement !== element("time")) element("time").value = this.t.toFixed(this.digits);
    const play = element("play");
    play.textContent = this.playing ? "\u275a\u275a" : "\u25b6";
    play.setAttribute("aria-label", this.playing ? "Pause" : "Play");
  }
}
