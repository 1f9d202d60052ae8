// Writes dist/index.html, dist/assets/app.js and app.css, which web.cmake embeds.
import { build } from 'esbuild';
import { copyFile, mkdir } from 'node:fs/promises';
import { createRequire } from 'node:module';

const { resolve } = createRequire(import.meta.url);

// The sources of three instead of its bundle, of which unused parts cannot be
// left out: the pages need its camera and its controls, but no renderer.
const threeWithoutRenderer = {
  name: 'three-without-renderer',
  setup: ({ onResolve }) =>
    onResolve({ filter: /^three$/ }, () => ({
      path: resolve('three/src/Three.Core.js'),
      sideEffects: false,
    })),
};

await mkdir('dist/assets', { recursive: true });
await build({
  entryPoints: { app: 'src/main.tsx' },
  outdir: 'dist/assets',
  bundle: true,
  minify: true,
  format: 'esm',
  target: 'es2021',
  jsx: 'automatic',
  jsxImportSource: 'preact',
  legalComments: 'eof',
  logLevel: 'warning',
  plugins: [threeWithoutRenderer],
});
await copyFile('index.html', 'dist/index.html');
