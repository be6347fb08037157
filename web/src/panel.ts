// One episode: its road, what is offered and why not the rest, and what is observed.
import { actionWords, wordsOf, type Clause, type Data, type Moment, type Objection } from "./data";
import type { Drive } from "./drive";
import { attribute, make, write } from "./dom";
import { Editor } from "./edit";
import { drawRoad, type Camera, type Look } from "./road";
import type { Rules } from "./rules";

export class Panel {
  readonly element: HTMLElement;
  readonly canvas: HTMLCanvasElement;
  private readonly tools = make("div", { class: "tools" });
  frame = 0;
  moment: Moment;
  camera: Camera | null = null;
  // A moment that was changed in the page, in place of the recorded one.
  private changed: Moment | null = null;
  private selected: string | null = null;
  private held: Camera | null = null;
  private readonly clauses: Clause[];
  private changedClauses: Clause[] = [];
  private readonly facts = make("p", { class: "facts" });
  private readonly alarm = make("p", { class: "alarm", role: "status" });
  private readonly cards: ActionCard[];
  private readonly observed: HTMLElement[];
  private shown = "";

  constructor(readonly drive: Drive, private readonly page: Data, choose: HTMLElement) {
    const { data } = drive;
    this.clauses = data.clauses;
    this.canvas = make("canvas", { class: "road", tabindex: 0, role: "img" });
    this.cards = page.actions.map((action) => new ActionCard(action, data.wants));
    this.observed = data.observation.map(() => make("td"));
    const rows = data.observation.map(([name], n) => make("tr", {}, make("th", { scope: "row" }, name), this.observed[n]!));
    this.element = make(
      "article",
      { class: "panel", "aria-label": data.name },
      make("header", {}, choose, make("span", { class: `ending ${data.ending.kind}` }, data.ending.words)),
      this.canvas,
      this.facts,
      this.alarm,
      this.tools,
      make("ul", { class: "actions", "aria-label": "Actions" }, ...this.cards.map((card) => card.element)),
      make(
        "details",
        { class: "observation" },
        make("summary", {}, `Observation: ${data.observation.length} numbers`),
        make("table", {}, make("tbody", {}, ...rows)),
      ),
    );
    this.moment = drive.moment(0);
  }

  show(time: number): void {
    this.frame = this.drive.frameAt(time);
    this.moment = this.changed ?? this.drive.moment(this.frame);
    this.draw();
    this.tell();
  }

  draw(): void {
    const { ending } = this.drive.data;
    const struck = this.changed === null && this.frame === this.drive.length - 1 ? ending.vehicle : "";
    const look: Look = { colours: this.page.colours, selected: this.selected, struck };
    this.camera = drawRoad(this.canvas, this.moment, look, this.held);
  }

  resized(): void {
    for (const card of this.cards) card.resized();
  }

  // Let the rules decide scenes that are changed here, or say why they cannot.
  offerEditing(rules: Rules, pause: () => void, say: (words: string) => void): void {
    this.changedClauses = rules.program.clauses;
    const editor = new Editor(this.canvas, rules, {
      moment: () => this.moment,
      camera: () => this.camera,
      show: (moment, selected) => this.showChanged(moment, selected),
      hold: (camera) => {
        this.held = camera;
      },
      begin: pause,
      say: (words) => say(`${words} ${this.summary()}`),
    });
    this.tools.append(editor.element);
  }

  refuseEditing(reason: string): void {
    this.tools.append(make("p", { class: "hint" }, `Vehicles cannot be dragged here: ${reason}`));
  }

  private showChanged(moment: Moment | null, selected: string | null): void {
    this.changed = moment;
    this.selected = selected;
    this.element.classList.toggle("changed", moment !== null);
    this.moment = moment ?? this.drive.moment(this.frame);
    this.draw();
    this.tell();
  }

  // What a screen reader says of the moment.
  summary(): string {
    const { moment, page } = this;
    const each = page.actions.map((action, n) => {
      const against = moment.objections[n]!.map(wordsOf).join("; ");
      const why = against === "" ? "" : ` because ${against}`;
      if (moment.offered[n]! && against !== "") return `${actionWords(action)} is offered against the rules: ${against}`;
      return moment.offered[n]! ? `${actionWords(action)} is offered` : `${actionWords(action)} is refused${why}`;
    });
    return `${this.drive.data.name}: ${this.factWords()}. ${each.join(". ")}.`;
  }

  private factWords(): string {
    const { moment } = this;
    const words = [`${Math.abs(moment.scene.ego.vx_mps).toFixed(1)} m/s`];
    if (Number.isFinite(moment.targetSpeed)) words.push(`target ${moment.targetSpeed.toFixed(1)} m/s`);
    if (this.changed !== null) words.push("changed by you");
    if (moment.distance !== null) words.push(`${moment.distance.toFixed(0)} m`);
    return words.join(" · ");
  }

  private tell(): void {
    const { moment, drive } = this;
    const last = this.frame === drive.length - 1 && ["contact", "off_road"].includes(drive.data.ending.kind);
    const ending = last && this.changed === null ? drive.data.ending.words : "";
    write(this.facts, this.factWords());
    write(this.alarm, moment.failure === "" ? ending : `fail-safe: ${moment.failure}`);
    this.cards.forEach((card, n) => card.tell(moment, n, this.changed === null ? this.clauses : this.changedClauses));
    this.observed.forEach((cell, n) => write(cell, moment.observation[n]?.toFixed(3) ?? "–"));
    const told = this.summary();
    if (told !== this.shown) attribute(this.canvas, "aria-label", told);
    this.shown = told;
  }
}

class ActionCard {
  readonly element: HTMLLIElement;
  private readonly badge = make("span", { class: "badge" });
  private readonly value = make("span", { class: "value" });
  private readonly chosen = make("span", { class: "chosen" });
  private readonly reasons = make("ul", { class: "reasons" });
  private told = "";
  private tallest = 0;

  constructor(action: string, private readonly wants: string) {
    const name = make("strong", {}, actionWords(action));
    this.element = make("li", { class: "action" }, make("div", {}, name, this.badge, this.chosen, this.value), this.reasons);
  }

  tell(moment: Moment, action: number, clauses: Clause[]): void {
    const offered = moment.offered[action]!;
    const against = offered && moment.objections[action]!.length > 0;
    attribute(this.element, "class", `action ${offered && !against ? "offered" : "refused"}`);
    write(this.badge, against ? "offered against the rules" : offered ? "offered" : "not offered");
    write(this.chosen, moment.action === action ? "chosen" : "");
    write(this.value, valueWords(moment.preferences, action, this.wants));
    this.tellReasons(moment.objections[action]!, offered || moment.failure !== "", clauses);
  }

  // The card keeps the height of the longest reasons so far, or all below it would jump while time runs.
  private settle(): void {
    if (this.element.offsetHeight <= this.tallest) return;
    this.tallest = this.element.offsetHeight;
    this.element.style.minHeight = `${this.tallest}px`;
  }

  resized(): void {
    this.tallest = 0;
    this.element.style.minHeight = "";
    this.settle();
  }

  private tellReasons(found: Objection[], silent: boolean, clauses: Clause[]): void {
    const words = found.map((one) => `${wordsOf(one)}\0${one.clause}`).join("\n");
    if (words === this.told && words !== "") return;
    if (found.length === 0) {
      const none = silent ? "" : "not derived by the rules";
      if (this.told !== `-${none}`) this.reasons.replaceChildren(...(none === "" ? [] : [make("li", {}, none)]));
      this.told = `-${none}`;
      this.settle();
      return;
    }
    this.told = words;
    // A clause stands below the last of its reasons.
    const order = [...new Set(found.map((one) => one.clause))];
    const items = order.flatMap((clause) => {
      const words = found.filter((one) => one.clause === clause).map((one) => make("li", {}, wordsOf(one)));
      words[words.length - 1]!.append(...[clauseOf(clauses[clause])].filter((one) => one !== null));
      return words;
    });
    this.reasons.replaceChildren(...items);
    this.settle();
  }
}

function clauseOf(clause: Clause | undefined): HTMLElement | null {
  if (clause === undefined) return null;
  const place = make("span", { class: "place" }, `${clause.file}:${clause.line}`);
  return make("code", { class: "clause" }, place, clause.text);
}

function valueWords(preferences: number[] | null, action: number, wants: string): string {
  if (preferences === null) return "";
  const value = preferences[action]!;
  if (Number.isNaN(value)) return "";
  const best = Math.max(...preferences) === value ? " (best)" : "";
  const shown = Number.isFinite(value) ? value.toFixed(Math.abs(value) >= 100 ? 0 : 2) : "never";
  return `${wants === "Q-values" ? "Q" : "wants"} ${shown}${best}`;
}
