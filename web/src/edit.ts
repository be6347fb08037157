// A scene to be changed: vehicles are dragged, moved by keys or by number, and the rules decide anew.
import { forward, laneOf, type Box, type Defaults, type Moment, type Scene, type Vehicle } from "./data";
import { attribute, make, write } from "./dom";
import { pixel, place, type Camera } from "./road";
import type { Rules } from "./rules";

// From so near its centre line on, a vehicle that is dragged takes it [m].
const SNAP = 0.8;
// How far from a vehicle one may touch to drag it [pixel].
const REACH = 12;
const AHEAD = 30;

export interface Edited {
  // The moment that is shown when editing begins.
  moment(): Moment;
  camera(): Camera | null;
  // Show a decision about a changed scene; null: the recorded one again.
  show(moment: Moment | null, selected: string | null): void;
  // While a vehicle is dragged the road must stand still.
  hold(camera: Camera | null): void;
  begin(): void;
  say(words: string): void;
}

export class Editor {
  readonly element = make("section", { class: "edit", "aria-label": "What if" });
  private scene: Scene | null = null;
  private selected = "ego";
  private offered = "";
  private drag: { dx: number; dy: number } | null = null;
  private readonly start = make("button", { type: "button", click: () => this.begin() }, "What if …");
  private readonly hint = make("span", { class: "hint" }, "or drag a vehicle: the rules decide anew");
  private readonly fields = make("div", { class: "fields" });
  private readonly vehicle = make("select", { change: () => this.select(this.vehicle.value) });
  private readonly ahead = this.number("0.5", (value) => this.move({ ahead: value }));
  private readonly across = this.number("0.25", (value) => this.move({ across: value }));
  private readonly speed = this.number("1", (value) => this.move({ speed: value }));
  private readonly text = make("textarea", { rows: 8, spellcheck: "false", "aria-label": "scene.json" });
  private readonly problem = make("p", { class: "alarm", role: "alert" });

  constructor(private readonly canvas: HTMLCanvasElement, private readonly rules: Rules, private readonly view: Edited) {
    const button = (words: string, act: () => void): HTMLElement => make("button", { type: "button", click: act }, words);
    const label = (words: string, field: HTMLElement): HTMLElement => make("label", {}, words, field);
    this.fields.append(
      label("vehicle ", this.vehicle),
      label("ahead of the ego, m ", this.ahead),
      label("across, m ", this.across),
      label("speed, m/s ", this.speed),
      button("Add a vehicle", () => this.add()),
      button("Remove", () => this.remove()),
      button("Copy as scene.json", () => void this.copy()),
      button("Undo all changes", () => this.end()),
      make(
        "details",
        { class: "text" },
        make("summary", {}, "scene.json"),
        this.text,
        button("Use this text", () => this.paste()),
      ),
      this.problem,
    );
    this.fields.hidden = true;
    this.element.append(this.start, this.hint, this.fields);
    canvas.classList.add("editable");
    canvas.addEventListener("pointerdown", (event) => this.press(event));
    canvas.addEventListener("pointermove", (event) => this.pull(event));
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => this.release());
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  private number(step: string, act: (value: number) => void): HTMLInputElement {
    const input = make("input", { type: "number", step });
    input.addEventListener("input", () => {
      if (Number.isFinite(input.valueAsNumber)) act(input.valueAsNumber);
    });
    return input;
  }

  private begin(): Scene {
    if (this.scene !== null) return this.scene;
    this.view.begin();
    this.scene = structuredCopy(this.view.moment().scene);
    this.fields.hidden = false;
    this.start.hidden = this.hint.hidden = true;
    this.offered = "";
    this.decide();
    this.select("ego");
    return this.scene;
  }

  private end(): void {
    this.scene = null;
    this.drag = null;
    this.fields.hidden = true;
    this.start.hidden = this.hint.hidden = false;
    this.view.hold(null);
    this.view.show(null, null);
    this.canvas.focus();
  }

  private box(): Box {
    const scene = this.scene!;
    return scene.vehicles.find((one) => one.id === this.selected) ?? scene.ego;
  }

  private select(id: string): void {
    this.selected = id;
    this.decide();
  }

  private decide(): void {
    const scene = this.scene!;
    const moment = this.rules.decide(scene);
    this.view.show(moment, this.selected);
    this.fill(scene);
    const offered = JSON.stringify(moment.offered);
    if (this.offered !== "" && offered !== this.offered) this.view.say("The rules decide otherwise now.");
    this.offered = offered;
  }

  // Show the numbers of the selected vehicle, but not in a field that is being typed in.
  private fill(scene: Scene): void {
    const names = ["ego", ...scene.vehicles.map((one) => one.id)];
    if (names.join("\0") !== [...this.vehicle.options].map((one) => one.value).join("\0")) {
      this.vehicle.replaceChildren(...names.map((name) => make("option", { value: name }, name)));
    }
    this.vehicle.value = this.selected;
    const box = this.box();
    const sign = forward(scene);
    const values: [HTMLInputElement, number][] = [
      [this.ahead, (box.x_m - scene.ego.x_m) * sign],
      [this.across, box.y_m],
      [this.speed, box.vx_mps * headingOf(box, scene)],
    ];
    for (const [input, value] of values) if (document.activeElement !== input) input.value = String(rounded(value));
    this.ahead.disabled = this.selected === "ego";
    if (document.activeElement !== this.text) this.text.value = JSON.stringify(scene, null, 2);
    write(this.problem, "");
  }

  private move({ ahead, across, speed }: { ahead?: number; across?: number; speed?: number }): void {
    const scene = this.scene!;
    const box = this.box();
    if (ahead !== undefined) box.x_m = rounded(scene.ego.x_m + ahead * forward(scene));
    if (across !== undefined) this.putAcross(box, across);
    if (speed !== undefined) box.vx_mps = rounded(speed * headingOf(box, scene));
    this.decide();
  }

  // Put a vehicle elsewhere across the road: it drives straight on there, and steers for the lane that it is in.
  private putAcross(box: Box, y: number): void {
    if (y === box.y_m) return;
    box.y_m = rounded(y);
    box.vy_mps = 0;
    delete box.lane;
    if (box === this.scene!.ego) delete this.scene!.ego.target_lane;
  }

  private add(): void {
    const scene = this.scene!;
    const { ego } = scene;
    const ids = new Set(scene.vehicles.map((one) => one.id));
    let n = 1;
    while (ids.has(`new${n}`)) n += 1;
    const { target_lane: _, ...box } = ego;
    scene.vehicles.push({ ...box, id: `new${n}`, x_m: rounded(ego.x_m + AHEAD * forward(scene)), vy_mps: 0 });
    this.select(`new${n}`);
  }

  private remove(): void {
    const scene = this.scene!;
    scene.vehicles = scene.vehicles.filter((one) => one.id !== this.selected);
    this.select("ego");
  }

  private async copy(): Promise<void> {
    const text = JSON.stringify(this.scene, null, 2);
    try {
      await navigator.clipboard.writeText(text);
      this.view.say("Copied as scene.json.");
    } catch {
      // A browser that does not let a page write there: the text can be copied by hand.
      this.text.closest("details")!.open = true;
      this.text.select();
      this.view.say("The text of scene.json is selected: copy it.");
    }
  }

  private paste(): void {
    try {
      const scene = JSON.parse(this.text.value) as Scene;
      const problem = this.rules.problemOf(scene);
      if (problem !== null) throw new Error(problem);
      this.scene = withDefaults(scene, this.rules.defaults);
      this.text.blur();
      this.select("ego");
      this.view.say("The rules have decided the pasted scene.");
    } catch (problem) {
      write(this.problem, `This is no scene: ${problem instanceof Error ? problem.message : problem}`);
    }
  }

  // Pointer and keys

  private at(event: PointerEvent): { camera: Camera; left: number; top: number } | null {
    const camera = this.view.camera();
    if (camera === null) return null;
    const edges = this.canvas.getBoundingClientRect();
    return { camera, left: event.clientX - edges.left, top: event.clientY - edges.top };
  }

  private press(event: PointerEvent): void {
    const at = this.at(event);
    if (at === null || event.button !== 0) return;
    const id = touched(this.scene ?? this.view.moment().scene, at.camera, at.left, at.top);
    if (id === null) return;
    event.preventDefault();
    this.begin();
    this.selected = id;
    const box = this.box();
    const [x, y] = place(at.camera, at.left, at.top);
    this.drag = { dx: box.x_m - x, dy: box.y_m - y };
    this.view.hold(at.camera);
    this.canvas.setPointerCapture(event.pointerId);
    this.canvas.focus();
    this.decide();
  }

  private pull(event: PointerEvent): void {
    const at = this.at(event);
    if (at === null) return;
    if (this.drag === null || this.scene === null) {
      const id = touched(this.scene ?? this.view.moment().scene, at.camera, at.left, at.top);
      attribute(this.canvas, "data-over", id ?? "");
      return;
    }
    const [x, y] = place(at.camera, at.left, at.top);
    const box = this.box();
    box.x_m = Math.round((x + this.drag.dx) * 10) / 10;
    this.putAcross(box, snapped(y + this.drag.dy, this.scene));
    this.decide();
  }

  private release(): void {
    if (this.drag === null) return;
    this.drag = null;
    this.view.hold(null);
    this.decide();
  }

  private key(event: KeyboardEvent): void {
    if (this.scene === null || event.altKey || event.ctrlKey || event.metaKey) return;
    const scene = this.scene;
    const box = this.box();
    const far = event.shiftKey ? 10 : 1;
    const names = ["ego", ...scene.vehicles.map((one) => one.id)];
    const next = (by: number): void => {
      this.select(names[(names.indexOf(this.selected) + by + names.length) % names.length]!);
    };
    const along = (by: number) => (): void => {
      box.x_m = rounded(box.x_m + by * far);
      this.decide();
    };
    const speed = box.vx_mps * headingOf(box, scene);
    const acts: Record<string, () => void> = {
      ArrowLeft: along(-1),
      ArrowRight: along(1),
      ArrowUp: () => this.move({ across: box.y_m - 0.25 * far }),
      ArrowDown: () => this.move({ across: box.y_m + 0.25 * far }),
      "+": () => this.move({ speed: speed + 1 }),
      "=": () => this.move({ speed: speed + 1 }),
      "-": () => this.move({ speed: speed - 1 }),
      "[": () => next(-1),
      "]": () => next(1),
      a: () => this.add(),
      Delete: () => this.remove(),
      Escape: () => this.end(),
    };
    const act = acts[event.key];
    if (act === undefined) return;
    event.preventDefault();
    act();
  }
}

export const EDIT_KEYS: [string, string][] = [
  ["on the road: [ ]", "choose a vehicle, while a scene is changed"],
  ["← → ↑ ↓", "move it; with Shift farther"],
  ["− +", "slower, faster"],
  ["A, Delete, Escape", "add one, remove it, undo all changes"],
];

function headingOf(box: Box, scene: Scene): number {
  const lane = scene.road.lanes.find((one) => one.id === laneOf(box, scene));
  if (lane === undefined) return box.vx_mps < 0 ? -1 : 1;
  return lane.direction === "left_to_right" ? 1 : -1;
}

function snapped(y: number, scene: Scene): number {
  const lane = scene.road.lanes.find((one) => Math.abs(one.centre_m - y) <= SNAP);
  return lane?.centre_m ?? y;
}

// The vehicle at a place of the picture: the nearest of those within reach.
function touched(scene: Scene, camera: Camera, left: number, top: number): string | null {
  let best: [number, string] | null = null;
  for (const car of [{ ...scene.ego, id: "ego" }, ...scene.vehicles] as Vehicle[]) {
    const [x, y] = pixel(camera, car.x_m, car.y_m);
    const dx = Math.max(Math.abs(left - x) - (car.length_m * camera.along) / 2, 0);
    const dy = Math.max(Math.abs(top - y) - (car.width_m * camera.across) / 2, 0);
    const away = Math.hypot(dx, dy);
    if (away <= REACH && (best === null || away < best[0])) best = [away, car.id];
  }
  return best === null ? null : best[1];
}

// The scene with what a scene.json may leave out.
function withDefaults(scene: Scene, { vy_mps, length_m, width_m, time_step_s, radar_range_m }: Defaults): Scene {
  const whole = <Kind extends Box>(box: Kind): Kind => Object.assign({ vy_mps, length_m, width_m }, box);
  return {
    road: Object.assign({ time_step_s, radar_range_m }, scene.road),
    ego: whole(scene.ego),
    vehicles: (scene.vehicles ?? []).map(whole),
  };
}

function structuredCopy<Value>(value: Value): Value {
  return JSON.parse(JSON.stringify(value)) as Value;
}

function rounded(value: number): number {
  return Math.round(value * 1000) / 1000;
}
