// Formulas between \( \) and \[ \], which the page builder writes for $ $ and $$ $$; in notebooks $ $.
window.MathJax = {
  tex: {
    inlineMath: [["\\(", "\\)"], ["$", "$"]],
    displayMath: [["\\[", "\\]"], ["$$", "$$"]],
    processEscapes: true,
  },
  options: {
    ignoreHtmlClass: ".+",
    processHtmlClass: "arithmatex|jp-RenderedMarkdown",
    enableMenu: false,
  },
  startup: {
    pageReady: () => MathJax.startup.defaultPageReady().then(markWideFormulas),
  },
};

// Formulas in the text that are wider than the text scroll by themselves (extra.css).
function markWideFormulas() {
  const formulas = document.querySelectorAll("span.arithmatex");
  formulas.forEach((formula) => formula.classList.remove("wide"));
  const text = document.querySelector(".md-content__inner");
  if (!text) return;
  const right = text.getBoundingClientRect().right;
  const wide = [...formulas].filter((formula) => formula.getBoundingClientRect().right > right + 1);
  wide.forEach((formula) => formula.classList.add("wide"));
}
window.addEventListener("resize", markWideFormulas);
