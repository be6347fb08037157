// Several episodes side by side, with one clock.
import type { Data, ProgramData } from "./data";
import { attribute, make, write } from "./dom";
import { Drive, inflate } from "./drive";
import { EDIT_KEYS } from "./edit";
import { Panel } from "./panel";
import { Rules } from "./rules";
import { MARKS, nextMark, Timeline } from "./timeline";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];

const KEYS: [string, string][] = [
  ["Space", "play or pause"],
  ["← →", "a frame back, a frame on; with Shift a second"],
  ["N, P", "to the next mark, to the one before"],
  ["− +", "slower, faster"],
  ["Home, End", "to the beginning, to the end"],
];

export class Viewer {
  private readonly drives = new Map<number, Promise<Drive>>();
  private readonly rules = new Map<ProgramData, Promise<Rules>>();
  private readonly panels: Panel[] = [];
  private readonly place = make("section", { class: "panels", "aria-label": "Episodes" });
  private readonly footer = make("footer", { class: "controls" });
  private readonly play = make("button", { type: "button", class: "play", click: () => this.toggle() }, "Play");
  private readonly scrub = make("input", { type: "range", min: 0, step: "any", "aria-label": "Time", input: () => this.seek(Number(this.scrub.value)) });
  private readonly clock = make("output", { class: "clock" });
  private readonly speed = make("select", { "aria-label": "Speed" });
  private readonly spoken = make("p", { class: "spoken", "aria-live": "polite" });
  private readonly timeline: Timeline;
  private readonly marks = make("canvas", { class: "timeline", "aria-hidden": "true" });
  private time = 0;
  private playing = false;
  private last = 0;

  constructor(private readonly data: Data, private readonly main: HTMLElement) {
    this.timeline = new Timeline(this.marks, data.colours, (time) => this.seek(time));
    for (const speed of SPEEDS) {
      this.speed.append(make("option", { value: speed, selected: speed === 1 }, `${speed}×`));
    }
  }

  async start(): Promise<void> {
    this.footer.append(...this.controls());
    this.main.replaceChildren(this.place, this.footer, this.spoken);
    const [asked, time] = this.asked();
    for (const episode of asked) await this.add(episode);
    this.seek(time);
    document.addEventListener("keydown", (event) => this.key(event));
    window.addEventListener("resize", () => {
      for (const panel of this.panels) panel.resized();
      this.show();
    });
    window.addEventListener("hashchange", () => void this.follow());
    document.documentElement.dataset["ready"] = "true";
  }

  // The episodes and the time that the address asks for: #episode=2,5&time=12.3
  private asked(): [number[], number] {
    const asked = new URLSearchParams(location.hash.slice(1));
    const numbers = (asked.get("episode") ?? "").split(",").filter((one) => one !== "").map((one) => Number(one) - 1);
    const known = numbers.filter((one) => this.data.episodes[one] !== undefined);
    const shown = known.length > 0 ? known : this.data.show;
    const begin = Math.min(...shown.map((one) => this.data.episodes[one]!.begin));
    return [shown, asked.has("time") ? Number(asked.get("time")) || 0 : begin];
  }

  private async follow(): Promise<void> {
    const [asked, time] = this.asked();
    this.panels.splice(0);
    this.place.replaceChildren();
    for (const episode of asked) await this.add(episode);
    this.seek(time);
  }

  private drive(episode: number): Promise<Drive> {
    const known = this.drives.get(episode);
    if (known !== undefined) return known;
    const data = this.data.episodes[episode]!;
    const made = inflate(data.columns).then((bytes) => new Drive(data, this.data, bytes));
    this.drives.set(episode, made);
    return made;
  }

  private async add(episode: number): Promise<void> {
    const panel = await this.panel(episode);
    this.panels.push(panel);
    this.place.append(panel.element);
    this.changed();
  }

  private async panel(episode: number): Promise<Panel> {
    const panel = new Panel(await this.drive(episode), this.data, this.chooser(episode));
    const program = this.data.programs[panel.drive.data.program]!;
    if (program.module === null) {
      panel.refuseEditing(program.refused);
      return panel;
    }
    let rules = this.rules.get(program);
    if (rules === undefined) this.rules.set(program, (rules = Rules.load(program, this.data)));
    void rules.then(
      (loaded) => panel.offerEditing(loaded, () => this.pause(), (words) => write(this.spoken, words)),
      (problem) => panel.refuseEditing(`the rules cannot be run by this browser: ${problem}`),
    );
    return panel;
  }

  private async replace(panel: Panel, episode: number): Promise<void> {
    const made = await this.panel(episode);
    this.panels[this.panels.indexOf(panel)] = made;
    panel.element.replaceWith(made.element);
    this.changed();
    if (this.panels.length === 1) this.seek(made.drive.data.begin);
    made.element.querySelector("select")?.focus();
  }

  private remove(panel: Panel): void {
    this.panels.splice(this.panels.indexOf(panel), 1);
    panel.element.remove();
    this.changed();
  }

  // The episode of a panel, to be changed, and the panel to be closed.
  private chooser(episode: number): HTMLElement {
    const mine = (event: Event): Panel =>
      this.panels.find((panel) => panel.element.contains(event.currentTarget as Node))!;
    const { episodes } = this.data;
    if (episodes.length === 1) return make("h2", {}, episodes[0]!.name);
    const select = make("select", {
      "aria-label": "Episode",
      change: (event) => void this.replace(mine(event), Number(select.value)),
    });
    episodes.forEach((one, n) => select.append(make("option", { value: n, selected: n === episode }, `${one.name}: ${one.ending.words}`)));
    const close = make("button", { type: "button", class: "close", "aria-label": "Close this episode", click: (event) => this.remove(mine(event)) }, "×");
    return make("h2", {}, select, close);
  }

  private controls(): HTMLElement[] {
    const step = (words: string, label: string, act: () => void): HTMLElement =>
      make("button", { type: "button", "aria-label": label, title: label, click: act }, words);
    const more = step("+ episode", "Show one more episode", () => void this.more());
    more.hidden = this.data.episodes.length < 2;
    more.className = "more";
    const legend = Object.values(MARKS).map(([colour, words]) => {
      const swatch = make("i", { class: "mark" });
      swatch.style.background = this.data.colours[colour]!;
      return make("li", {}, swatch, words);
    });
    const keys = [...KEYS, ...EDIT_KEYS].map(([key, words]) => make("li", {}, make("kbd", {}, key), ` ${words}`));
    return [
      this.marks,
      this.scrub,
      make(
        "div",
        { class: "buttons" },
        this.play,
        step("|◂", "A frame back", () => this.step(-1)),
        step("▸|", "A frame on", () => this.step(1)),
        step("◂ mark", "To the mark before", () => this.jump(-1)),
        step("mark ▸", "To the next mark", () => this.jump(1)),
        this.speed,
        this.clock,
        more,
        make(
          "details",
          { class: "help" },
          make("summary", {}, "Keys"),
          make("ul", {}, ...keys),
          make("ul", { class: "legend" }, ...legend),
        ),
      ),
    ];
  }

  private async more(): Promise<void> {
    const shown = this.panels.map((panel) => this.data.episodes.indexOf(panel.drive.data));
    const next = this.data.episodes.findIndex((_, n) => !shown.includes(n));
    await this.add(Math.max(next, 0));
  }

  private get duration(): number {
    return Math.max(0, ...this.panels.map((panel) => panel.drive.duration));
  }

  private get frameTime(): number {
    return Math.min(...this.panels.map((panel) => panel.drive.data.road.time_step_s), 1);
  }

  private changed(): void {
    attribute(this.scrub, "max", String(this.duration));
    this.footer.hidden = this.duration === 0 && this.data.episodes.length === 1;
    attribute(this.place, "data-count", String(Math.min(this.panels.length, 3)));
    this.show();
    for (const panel of this.panels) panel.resized();
  }

  private show(): void {
    for (const panel of this.panels) panel.show(this.time);
    this.timeline.draw(this.panels.map((panel) => panel.drive), this.duration, this.time);
    this.scrub.value = String(this.time);
    attribute(this.scrub, "aria-valuetext", `${this.time.toFixed(1)} seconds`);
    write(this.clock, `${this.time.toFixed(2)} / ${this.duration.toFixed(1)} s`);
  }

  seek(time: number): void {
    this.time = Math.min(Math.max(time, 0), this.duration);
    this.show();
    if (!this.playing) write(this.spoken, this.panels.map((panel) => panel.summary()).join(" "));
  }

  private toggle(): void {
    this.playing = !this.playing;
    write(this.play, this.playing ? "Pause" : "Play");
    if (!this.playing) {
      this.seek(this.time);
      return;
    }
    if (this.time >= this.duration) this.time = 0;
    this.last = performance.now();
    requestAnimationFrame((now) => this.tick(now));
  }

  private tick(now: number): void {
    if (!this.playing) return;
    this.time = Math.min(this.time + ((now - this.last) / 1000) * Number(this.speed.value), this.duration);
    this.last = now;
    this.show();
    if (this.time >= this.duration) this.toggle();
    else requestAnimationFrame((next) => this.tick(next));
  }

  private pause(): void {
    if (this.playing) this.toggle();
  }

  private step(frames: number): void {
    this.pause();
    this.seek((Math.round(this.time / this.frameTime) + frames) * this.frameTime);
  }

  private jump(direction: 1 | -1): void {
    this.pause();
    const found = nextMark(this.panels.map((panel) => panel.drive), this.time, direction);
    if (found === null) return;
    this.seek(found[0]);
    write(this.spoken, `${found[2].words}. ${this.panels.map((panel) => panel.summary()).join(" ")}`);
  }

  private faster(by: 1 | -1): void {
    this.speed.selectedIndex = Math.min(Math.max(this.speed.selectedIndex + by, 0), SPEEDS.length - 1);
  }

  private key(event: KeyboardEvent): void {
    const target = event.target as HTMLElement;
    if (event.altKey || event.ctrlKey || event.metaKey || event.defaultPrevented) return;
    const typing = target.matches("select, textarea, input:not([type=range])");
    const pressing = target.matches("button, summary") && [" ", "Enter"].includes(event.key);
    if (typing || pressing) return;
    const second = Math.max(1, Math.round(1 / this.frameTime));
    const acts: Record<string, () => void> = {
      " ": () => this.toggle(),
      ArrowLeft: () => this.step(event.shiftKey ? -second : -1),
      ArrowRight: () => this.step(event.shiftKey ? second : 1),
      n: () => this.jump(1),
      p: () => this.jump(-1),
      "+": () => this.faster(1),
      "=": () => this.faster(1),
      "-": () => this.faster(-1),
      Home: () => this.seek(0),
      End: () => this.seek(this.duration),
    };
    const act = acts[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (act === undefined) return;
    event.preventDefault();
    act();
  }
}
