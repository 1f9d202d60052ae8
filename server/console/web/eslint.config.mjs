// What test/lint asks of the pages, beside the compiler's checks.
import js from '@eslint/js';
import hooks from 'eslint-plugin-react-hooks';
import tseslint from 'typescript-eslint';

const root = new globalThis.URL('.', import.meta.url).pathname;

export default tseslint.config({ ignores: ['dist/', 'generated/'] }, js.configs.recommended, {
  files: ['src/**/*.{ts,tsx}'],
  extends: [tseslint.configs.recommendedTypeChecked],
  languageOptions: { parserOptions: { projectService: true, tsconfigRootDir: root } },
  plugins: { 'react-hooks': hooks },
  rules: hooks.configs.recommended.rules,
});
