// Shows the claims that fit the filter; without it, or without scripts, all are shown.
(() => {
  const form = document.getElementById("filter");
  const verdict = form.elements.verdict, figure = form.elements.figure, words = form.elements.words;
  const said = document.getElementById("shown");
  const claims = [...document.querySelectorAll("article.claim")].map((card) => ({
    card,
    row: document.getElementById("listed-" + card.id),
    text: card.textContent.toLowerCase(),
  }));
  const any = (part, selector) => part.querySelector(selector + ":not([hidden])") !== null;

  function apply() {
    const wanted = words.value.toLowerCase().split(/\s+/).filter(Boolean);
    let count = 0;
    for (const { card, row, text } of claims) {
      const shown =
        (!verdict.value || card.dataset.verdict === verdict.value) &&
        (!figure.value || card.dataset.figure === figure.value) &&
        wanted.every((word) => text.includes(word));
      card.hidden = row.hidden = !shown;
      count += shown;
    }
    const all = count === claims.length;
    for (const group of document.querySelectorAll(".group")) group.hidden = !any(group, "li");
    for (const part of document.querySelectorAll("section.figure")) {
      part.hidden = !all && !any(part, "article.claim");
    }
    said.textContent = all ? `all ${count} claims` : `${count} of ${claims.length} claims`;
  }

  function clear() {
    form.reset();
    apply();
  }

  form.addEventListener("input", apply);
  form.addEventListener("submit", (event) => event.preventDefault());
  document.getElementById("clear").addEventListener("click", clear);
  for (const button of document.querySelectorAll("button[data-verdict]")) {
    button.disabled = false;
    button.addEventListener("click", () => {
      verdict.value = button.dataset.verdict;
      apply();
    });
  }
  // A link to what is hidden shows all again.
  document.addEventListener("click", (event) => {
    const link = event.target.closest('a[href^="#"]');
    const target = link && document.getElementById(link.getAttribute("href").slice(1));
    if (target && target.closest("[hidden]")) clear();
  });
  form.hidden = false;
  apply();
})();
