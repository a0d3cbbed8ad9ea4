"use strict";
(() => {
  const element = (tag, attributes = {}, children = []) => {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    made.append(...children);
    return made;
  };

  // Lays the pictures of a comparison over each other: the left one shows up to the cut, the right one behind it.
  const compare = (box) => {
    const grid = box.querySelector(".grid");
    const pictures = [...grid.querySelectorAll("figure")].map((figure, index) => ({
      file: figure.querySelector("img").getAttribute("src"),
      name: figure.querySelector("img").alt || `Picture ${index + 1}`,
      caption: figure.querySelector("figcaption span")?.textContent ?? "",
    }));
    if (pictures.length < 2) return;

    const chooser = (name) =>
      element("select", { "aria-label": `${name} picture` }, pictures.map((p, index) => element("option", { value: index }, [p.name])));
    const selects = [chooser("Left"), chooser("Right")];
    const flip = element("button", { type: "button", title: "Show one picture, then the other (F or space)" }, ["Flip"]);
    const under = element("img", { class: "under", alt: "", draggable: "false", loading: "lazy" });
    const over = element("img", { class: "over", alt: "", draggable: "false", loading: "lazy" });
    const tags = [element("span", { class: "tag left" }), element("span", { class: "tag right" })];
    const stage = element(
      "div",
      { class: "stage", tabindex: "0", role: "slider", "aria-label": "Share of the left picture", "aria-valuemin": "0", "aria-valuemax": "100" },
      [under, over, ...tags, element("div", { class: "handle" })],
    );
    const shown = element("div", { class: "shown" }, [element("p"), element("p")]);
    let cut = 50;
    let chosen = [0, 1];

    const move = (percent) => {
      cut = Math.min(100, Math.max(0, percent));
      stage.style.setProperty("--cut", `${cut}%`);
      stage.setAttribute("aria-valuenow", Math.round(cut));
      const text = cut >= 100 ? tags[0].textContent : cut <= 0 ? tags[1].textContent : `${Math.round(cut)} %`;
      stage.setAttribute("aria-valuetext", text);
      tags[0].classList.toggle("hidden", cut < 12);
      tags[1].classList.toggle("hidden", cut > 88);
    };
    const turn = () => move(cut >= 50 ? 0 : 100);
    const choose = (side, index) => {
      // The same picture twice compares nothing, so the other side takes the one that was here.
      if (chosen[1 - side] === index) chosen[1 - side] = chosen[side];
      chosen[side] = index;
      show();
    };
    const show = () => {
      [over, under].forEach((image, side) => {
        const picture = pictures[chosen[side]];
        if (image.getAttribute("src") !== picture.file) image.src = picture.file;
        selects[side].value = chosen[side];
        tags[side].textContent = picture.name;
        const open = element("a", { href: picture.file }, ["full size"]);
        const caption = picture.caption ? ` ${picture.caption} · ` : " · ";
        shown.children[side].replaceChildren(element("b", {}, [picture.name]), caption, open);
      });
      move(cut);
    };

    const at = (event) => {
      const area = stage.getBoundingClientRect();
      move((100 * (event.clientX - area.left)) / area.width);
    };
    stage.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      stage.setPointerCapture(event.pointerId);
      at(event);
    });
    stage.addEventListener("pointermove", (event) => {
      if (stage.hasPointerCapture(event.pointerId)) at(event);
    });
    stage.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      const step = event.shiftKey ? 10 : 2;
      const keys = {
        ArrowLeft: () => move(cut - step),
        ArrowRight: () => move(cut + step),
        Home: () => move(0),
        End: () => move(100),
        " ": turn,
        f: turn,
        F: turn,
      };
      if (!keys[event.key]) return;
      event.preventDefault();
      keys[event.key]();
    });
    flip.addEventListener("click", turn);
    selects.forEach((select, side) => select.addEventListener("change", () => choose(side, Number(select.value))));

    const label = (name, select) => element("label", {}, [name, select]);
    const controls = element("div", { class: "controls" }, [
      label("Left", selects[0]),
      label("Right", selects[1]),
      flip,
      element("span", {}, ["Drag the handle; F flips"]),
    ]);
    grid.before(controls, stage, shown);
    box.classList.add("live");
    show();
  };
  document.querySelectorAll(".compare").forEach(compare);

  // Marks the section being read in the contents: the last one that has begun above the upper third of the window.
  const links = [...document.querySelectorAll("nav a")];
  const sections = [...document.querySelectorAll("main > section")];
  let waiting = false;
  let marked = -1;
  const mark = () => {
    waiting = false;
    const atEnd = innerHeight + scrollY >= document.documentElement.scrollHeight - 2 && scrollY > 0;
    let current = atEnd ? sections.length - 1 : sections.findLastIndex((section) => section.getBoundingClientRect().top < innerHeight / 3);
    if (current < 0) current = 0;
    if (current === marked) return;
    marked = current;
    links.forEach((link, index) => {
      if (link.classList.toggle("here", index === current)) link.setAttribute("aria-current", "true");
      else link.removeAttribute("aria-current");
    });
    // In a narrow window the contents are one line that scrolls.
    const link = links[current];
    const line = link?.closest("nav");
    if (line && line.scrollWidth > line.clientWidth) line.scrollTo({ left: link.offsetLeft - (line.clientWidth - link.offsetWidth) / 2 });
  };
  addEventListener("scroll", () => {
    if (!waiting) requestAnimationFrame(mark);
    waiting = true;
  }, { passive: true });
  addEventListener("resize", mark);
  mark();
})();
