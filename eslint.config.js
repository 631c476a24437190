// The page's scripts: standard rules, names of browsers only.
import js from "@eslint/js";
import globals from "globals";

export default [
  { ignores: [".venv/", "build/", "out/", "runs/"] },
  js.configs.recommended,
  {
    files: ["appliance/console/page/*.js"],
    languageOptions: { ecmaVersion: 2022, sourceType: "module", globals: globals.browser },
    linterOptions: { reportUnusedDisableDirectives: "error" },
    rules: { eqeqeq: "error", "prefer-const": "error", "no-var": "error", "no-shadow": "error" },
  },
];
