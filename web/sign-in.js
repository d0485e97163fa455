// Signing in: hands the token of the printed link to the server, once, and takes it out of the address at once.

import { post } from "./api.js";

const progress = /** @type {HTMLElement} */ (document.getElementById("progress"));
const form = /** @type {HTMLFormElement} */ (document.getElementById("token-form"));
const field = /** @type {HTMLInputElement} */ (document.getElementById("token"));

/** @param {string} token */
async function signIn(token) {
  progress.textContent = "Signing in…";
  progress.className = "";
  const answer = await post("/api/sign-in", { token });
  if (answer.ok) {
    location.replace("/");
    return;
  }
  progress.textContent = `Not signed in: ${answer.status === 401 && !answer.reason ? "the token is not valid" : answer.reason}`;
  progress.className = "problem";
  form.hidden = false;
  field.focus();
}

form.addEventListener("submit", (event) => {
  event.preventDefault();
  void signIn(field.value.trim());
});

const token = new URLSearchParams(location.search).get("token") ?? "";
history.replaceState(null, "", location.pathname);
if (token) {
  void signIn(token);
} else {
  progress.textContent = "Open the link that the program printed, or enter its token.";
  form.hidden = false;
}
