(** Certificates of maximal boxes: bad values arbitrarily near to each face that could be moved. *)

Require Import Reals QArith Qreals List Bool PArith ZArith Lra Lia FMapPositive Classical.
Require Import Spec Claims States Closed Kernel Checker Orders Certificate Bad Good.
Import ListNotations.
Open Scope R_scope.

(** ** The sides of a box *)

Definition sides_of_range (i : nat) (r : range) : list (expr * bool) :=
  match lower r with Some (q, closed) => [(Minus (Param i) (Num q), negb closed)] | None => [] end ++
  match upper r with Some (q, closed) => [(Minus (Num q) (Param i), negb closed)] | None => [] end.

Fixpoint sides_from (i : nat) (b : list range) : list (expr * bool) :=
  match b with [] => [] | r :: b => sides_of_range i r ++ sides_from (S i) b end.

Definition sides := sides_from 0.

Lemma in_range_sides g i r : in_range r (g i) <-> inside g (sides_of_range i r).
Proof.
  unfold in_range, inside, sides_of_range. split.
  - intros [L U] e s I. apply in_app_iff in I as [I|I].
    + destruct (lower r) as [[q c]|]; [|easy]. destruct I as [I|[]]. destruct c; inversion I; simpl; lra.
    + destruct (upper r) as [[q c]|]; [|easy]. destruct I as [I|[]]. destruct c; inversion I; simpl; lra.
  - intros H. split.
    + destruct (lower r) as [[q c]|]; [|easy]. specialize (H _ _ (or_introl eq_refl)). destruct c; simpl in *; lra.
    + destruct (upper r) as [[q c]|]; [|easy].
      specialize (H (Minus (Num q) (Param i)) (negb c)). rewrite in_app_iff in H. specialize (H (or_intror (or_introl eq_refl))).
      destruct c; simpl in *; lra.
Qed.

Lemma in_box_sides g b : in_box g b <-> inside g (sides b).
Proof.
  unfold in_box, sides. assert (A : forall k, (forall i r, nth_error b i = Some r -> in_range r (g (k + i)%nat)) <->
    inside g (sides_from k b)).
  { induction b as [|r b IH]; intros k; simpl.
    - split; [easy|]. intros _ [|i] r; easy.
    - split.
      + intros H e s I. apply in_app_iff in I as [I|I].
        * revert e s I. apply in_range_sides. specialize (H 0%nat r eq_refl). now rewrite Nat.add_0_r in H.
        * revert e s I. apply IH. intros i r' E. specialize (H (S i) r' E). now rewrite Nat.add_succ_r in H.
      + intros H [|i] r' E; simpl in E.
        * inversion E. subst. rewrite Nat.add_0_r. apply in_range_sides. intros e s I. apply H, in_app_iff. now left.
        * rewrite Nat.add_succ_r. apply (IH (S k)); auto. intros e s I. apply H, in_app_iff. now right. }
  rewrite <- (A 0%nat). reflexivity.
Qed.

(** ** Segments that begin on a face *)

(** From [limit], which is on the face, to [beyond], which is outside: all but the limit is bad. The parameter after the
    last one of the box says how far along, more than 0 and at most 1. *)
Record face := { limit : list Q; beyond : list Q; why : reason }.

Definition along (f : face) (n i : nat) : expr :=
  Plus (Num (nth i (limit f) 0%Q)) (Scale (nth i (beyond f) 0%Q - nth i (limit f) 0%Q)%Q (Param n)).

Definition segment (f : face) (n : nat) : list (expr * bool) :=
  (Param n, true) :: (Minus (Num 1) (Param n), false) ::
  flat_map (fun i => [(Minus (Param i) (along f n i), false); (Minus (along f n i) (Param i), false)]) (seq 0 n).

Definition closure (r : range) : range :=
  let close e := match e with Some (q, _) => Some (q : Q, true) | None => None end in
  {| lower := close (lower r); upper := close (upper r) |}.

Definition in_range_q (r : range) (x : Q) : bool :=
  match lower r with Some (q, closed) => sure (negb closed) (x - q) | None => true end &&
  match upper r with Some (q, closed) => sure (negb closed) (q - x) | None => true end.

(** The segment begins at the end [q] of the range [i], just outside of the box, and is within the box otherwise. *)
Definition begins (b : list range) (up : bool) (i : nat) (q : Q) (closed : bool) (f : face) : bool :=
  let away := (if up then nth i (beyond f) 0 - nth i (limit f) 0 else nth i (limit f) 0 - nth i (beyond f) 0)%Q in
  Qeq_bool (nth i (limit f) 0%Q) q && (if closed then positive_q away else Qeq_bool away 0) &&
  forallb (fun j => Nat.eqb j i || match nth_error b j with
    | Some r => in_range_q (closure r) (nth j (limit f) 0%Q) && in_range_q r (nth j (beyond f) 0%Q)
    | None => false
    end) (seq 0 (length b)).

(** An end that cannot be moved: there is none, or it is the declared one. *)
Definition fixed_end (e declared : option (Q * bool)) : bool :=
  match e, declared with
  | None, _ => true
  | Some (q, true), Some (d, _) => Qeq_bool q d
  | _, _ => false
  end.

Definition stuck (P : plan) (epsilon : Q) (b : list range) (up : bool) (i : nat) (e declared : option (Q * bool))
    (f : option face) : bool :=
  fixed_end e declared ||
  match e, f with
  | Some (q, closed), Some f => begins b up i q closed f && check_bad P epsilon (segment f (length b)) (why f)
  | _, _ => false
  end.

(** Faces of the lower and the upper end of each parameter, where they could be moved. *)
Definition check_faces (P : plan) (epsilon : Q) (declared b : list range) (faces : list (option face * option face)) : bool :=
  forallb (fun i => match nth_error b i, nth_error declared i, nth_error faces i with
    | Some r, Some d, Some (low, high) =>
        stuck P epsilon b false i (lower r) (lower d) low && stuck P epsilon b true i (upper r) (upper d) high
    | _, _, _ => false
    end) (seq 0 (length b)).

Definition check_maximal (P : plan) (epsilon : Q) (declared b : list range) (c : certificate)
    (faces : list (option face * option face)) : bool :=
  check P epsilon (sides declared) (sides b) c && check_faces P epsilon declared b faces.

(** ** Soundness *)

Lemma in_range_q_true r x : in_range_q r x = true -> in_range r (Q2R x).
Proof.
  unfold in_range_q, in_range. rewrite andb_true_iff. intros [L U]. split.
  - destruct (lower r) as [[q c]|]; auto. apply sure_true in L. unfold Qminus in L. rewrite Q2R_plus, Q2R_opp in L.
    destruct c; simpl in L; lra.
  - destruct (upper r) as [[q c]|]; auto. apply sure_true in U. unfold Qminus in U. rewrite Q2R_plus, Q2R_opp in U.
    destruct c; simpl in U; lra.
Qed.

(** On the way from the closure of a range into the range. *)
Lemma on_the_way r x y s : in_range (closure r) x -> in_range r y -> 0 < s <= 1 -> in_range r (x + s * (y - x)).
Proof.
  unfold in_range, closure. simpl. intros [L U] [L' U'] S. split.
  - destruct (lower r) as [[q []]|]; auto; nra.
  - destruct (upper r) as [[q []]|]; auto; nra.
Qed.

Lemma convex r x y z : in_range r x -> in_range r z -> x <= y <= z -> in_range r y.
Proof.
  unfold in_range. intros [L U] [L' U'] B. split.
  - destruct (lower r) as [[q []]|]; auto; lra.
  - destruct (upper r) as [[q []]|]; auto; lra.
Qed.

Section Maximal.
Variable P : plan.
Variable epsilon : Q.
Variables declared b wider : list range.
Variable p0 : nat -> R.
Hypothesis I0 : in_box p0 b.
Hypothesis N : length wider = length b.
Hypothesis Contains : forall g, in_box g b -> in_box g wider.
Hypothesis Good : forall g, in_box g wider -> in_box g declared /\ in_envelope P epsilon g.

Definition on_segment (f : face) (s : R) (i : nat) : R :=
  if Nat.eq_dec i (length b) then s
  else Q2R (nth i (limit f) 0%Q) + s * (Q2R (nth i (beyond f) 0%Q) - Q2R (nth i (limit f) 0%Q)).

Lemma on_segment_inside f s : 0 < s <= 1 -> inside (on_segment f s) (segment f (length b)).
Proof.
  intros S e strict [H|[H|H]].
  - inversion H. subst. simpl. unfold on_segment. destruct Nat.eq_dec; [lra | easy].
  - inversion H. subst. simpl. unfold on_segment. destruct Nat.eq_dec; [|easy]. rewrite one_R. lra.
  - apply in_flat_map in H as [i [I H]]. apply in_seq in I.
    assert (A : on_segment f s i = ev (on_segment f s) (fun _ => 0) (along f (length b) i)).
    { simpl. unfold on_segment. destruct (Nat.eq_dec i (length b)); [lia|]. destruct (Nat.eq_dec (length b) (length b)); [|easy].
      unfold Qminus. rewrite Q2R_plus, Q2R_opp. lra. }
    destruct H as [H|[H|[]]]; inversion H; subst; cbn [ev above]; rewrite <- A; lra.
Qed.

(** A wider box has values on the segment. *)
Lemma face_reached f up i q closed x s : begins b up i q closed f = true -> (i < length b)%nat ->
  in_box x wider -> 0 < s <= 1 ->
  (if up then p0 i <= on_segment f s i <= x i else x i <= on_segment f s i <= p0 i) -> in_box (on_segment f s) wider.
Proof.
  unfold begins. rewrite !andb_true_iff, forallb_forall. intros [_ O] L X S Y j r E.
  assert (J : (j < length b)%nat) by (rewrite <- N; apply nth_error_Some; congruence).
  destruct (Nat.eq_dec j i) as [->|D].
  - pose proof (Contains _ I0 _ _ E) as A. pose proof (X _ _ E) as B.
    destruct up; [apply (convex r (p0 i) _ (x i)) | apply (convex r (x i) _ (p0 i))]; auto.
  - assert (I : In j (seq 0 (length b))) by (apply in_seq; lia). apply O in I. apply orb_true_iff in I as [I|I].
    + apply Nat.eqb_eq in I. easy.
    + destruct (nth_error b j) as [r'|] eqn:E'; [|easy]. apply andb_true_iff in I as [A B].
      apply in_range_q_true in A. apply in_range_q_true in B.
      pose (z := fun k => if Nat.eq_dec k j then on_segment f s j else p0 k). assert (Z : in_box z b).
      { intros k r2 E2. unfold z. destruct (Nat.eq_dec k j) as [->|]; [|now apply I0].
        rewrite E' in E2. inversion E2. subst. unfold on_segment. destruct (Nat.eq_dec j (length b)); [lia|].
        now apply on_the_way. }
      apply Contains in Z. specialize (Z _ _ E). unfold z in Z. destruct (Nat.eq_dec j j); easy.
Qed.

(** How far along the segment the value [x] is reached, at most. *)
Lemma step_to away x : 0 < away -> 0 < x -> exists s, 0 < s <= 1 /\ s * away <= x.
Proof.
  intros A X. destruct (Rle_dec away x).
  - exists 1. lra.
  - exists (x / away). assert (x / away * away = x) by (field; lra). split; [|lra]. split; [apply Rdiv_lt_0_compat; lra | nra].
Qed.

Lemma stuck_low i r d f x : nth_error b i = Some r -> nth_error declared i = Some d ->
  stuck P epsilon b false i (lower r) (lower d) f = true -> in_box x wider ->
  match lower r with Some (q, closed) => if closed then Q2R q <= x i else Q2R q < x i | None => True end.
Proof.
  intros E D S X. apply NNPP. intros O. unfold stuck in S. apply orb_true_iff in S as [S|S].
  - unfold fixed_end in S. destruct (lower r) as [[q []]|]; try easy. destruct (lower d) as [[e c]|] eqn:F; [|easy].
    apply Qeq_bool_eq, Qeq_eqR in S. destruct (Good x X) as [Y _]. specialize (Y _ _ D). unfold in_range in Y. rewrite F in Y.
    destruct c; lra.
  - destruct (lower r) as [[q closed]|] eqn:F; [|easy]. destruct f as [f|]; [|easy]. apply andb_true_iff in S as [B C].
    pose proof (I0 _ _ E) as Y. unfold in_range in Y. rewrite F in Y.
    assert (L : (i < length b)%nat) by (apply nth_error_Some; congruence).
    assert (H : exists s, 0 < s <= 1 /\ x i <= on_segment f s i <= p0 i).
    { pose proof B as B'. unfold begins in B'. rewrite !andb_true_iff in B'. destruct B' as [[B1 B2] _].
      apply Qeq_bool_eq, Qeq_eqR in B1. unfold on_segment. destruct (Nat.eq_dec i (length b)); [lia|]. rewrite B1.
      destruct closed.
      - apply positive_q_dec in B2. unfold Qminus in B2. rewrite Q2R_plus, Q2R_opp, B1 in B2.
        destruct (step_to _ (Q2R q - x i) B2) as [s [S1 S2]]; [lra|]. exists s. split; [exact S1|]. split; nra.
      - apply Qeq_bool_eq, Qeq_eqR in B2. unfold Qminus in B2. rewrite Q2R_plus, Q2R_opp, B1, zero_R in B2.
        exists 1. split; [lra|]. split; nra. }
    destruct H as [s [S H]]. apply (check_bad_sound P epsilon _ (on_segment f s)) in C; [|now apply on_segment_inside].
    apply C, Good. apply (face_reached f false i q closed x); auto.
Qed.

Lemma stuck_high i r d f x : nth_error b i = Some r -> nth_error declared i = Some d ->
  stuck P epsilon b true i (upper r) (upper d) f = true -> in_box x wider ->
  match upper r with Some (q, closed) => if closed then x i <= Q2R q else x i < Q2R q | None => True end.
Proof.
  intros E D S X. apply NNPP. intros O. unfold stuck in S. apply orb_true_iff in S as [S|S].
  - unfold fixed_end in S. destruct (upper r) as [[q []]|]; try easy. destruct (upper d) as [[e c]|] eqn:F; [|easy].
    apply Qeq_bool_eq, Qeq_eqR in S. destruct (Good x X) as [Y _]. specialize (Y _ _ D). unfold in_range in Y. rewrite F in Y.
    destruct c; lra.
  - destruct (upper r) as [[q closed]|] eqn:F; [|easy]. destruct f as [f|]; [|easy]. apply andb_true_iff in S as [B C].
    pose proof (I0 _ _ E) as Y. unfold in_range in Y. rewrite F in Y.
    assert (L : (i < length b)%nat) by (apply nth_error_Some; congruence).
    assert (H : exists s, 0 < s <= 1 /\ p0 i <= on_segment f s i <= x i).
    { pose proof B as B'. unfold begins in B'. rewrite !andb_true_iff in B'. destruct B' as [[B1 B2] _].
      apply Qeq_bool_eq, Qeq_eqR in B1. unfold on_segment. destruct (Nat.eq_dec i (length b)); [lia|]. rewrite B1.
      destruct closed.
      - apply positive_q_dec in B2. unfold Qminus in B2. rewrite Q2R_plus, Q2R_opp, B1 in B2.
        destruct (step_to _ (x i - Q2R q) B2) as [s [S1 S2]]; [lra|]. exists s. split; [exact S1|]. split; nra.
      - apply Qeq_bool_eq, Qeq_eqR in B2. unfold Qminus in B2. rewrite Q2R_plus, Q2R_opp, B1, zero_R in B2.
        exists 1. split; [lra|]. split; nra. }
    destruct H as [s [S H]]. apply (check_bad_sound P epsilon _ (on_segment f s)) in C; [|now apply on_segment_inside].
    apply C, Good. apply (face_reached f true i q closed x); auto.
Qed.

End Maximal.

Theorem check_maximal_sound P epsilon declared b c faces : check_maximal P epsilon declared b c faces = true ->
  maximal P epsilon declared b.
Proof.
  unfold check_maximal. rewrite andb_true_iff. intros [C F]. apply check_sound in C as [[p0 I0] [W V]].
  apply in_box_sides in I0. split.
  - split; [eauto|]. intros g G. split; [apply in_box_sides, W, in_box_sides, G | apply V, in_box_sides, G].
  - intros wider N Contains [_ Good] x X i r E. unfold check_faces in F. rewrite forallb_forall in F.
    assert (L : In i (seq 0 (length b))) by (apply in_seq; split; [lia | apply nth_error_Some; congruence]).
    apply F in L. rewrite E in L. destruct (nth_error declared i) as [d|] eqn:D; [|easy].
    destruct (nth_error faces i) as [[low high]|]; [|easy]. apply andb_true_iff in L as [A B]. split.
    + exact (stuck_low P epsilon declared b wider p0 I0 N Contains Good i r d low x E D A X).
    + exact (stuck_high P epsilon declared b wider p0 I0 N Contains Good i r d high x E D B X).
Qed.
